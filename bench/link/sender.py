"""Sends the commands of all flows, each from a process of its own: `python -m bench.link.sender`, started by bench/link/run.py.

The first line of the standard input is JSON: endpoint and lease of each flow, the folder of the keys, and how
many flows share a process. Prints `ready` when all
sessions are open. The line `end` ends the program; it prints its lateness as a line of JSON.
"""

import json
import math
import os
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from threading import Lock

import zenoh

from bench.link.children import Pipe, fork_each
from bench.link.lateness import Lateness
from bench.link.sessions import COMMAND_KEY, TOKEN_KEY, Security, open_at
from bench.robots.feeder import COMMAND_HZ, CRUISE_M_S, SPREAD
from wire import tls
from wire.bundle import choose_bundle
from wire.messages import encode, planar_twist
from wire.stamp import Stamper


@dataclass(frozen=True)
class Source:
    """A command source."""

    process: int
    """Number of the process in which it runs."""
    endpoint: str
    """Of its hub."""
    lease_s: float
    security: Security


_OPENING = Lock()
"""Taken while a session opens: many handshakes at once, in one process, starve each other until they time out."""


def send(source: Source, pipe: Pipe) -> None:
    """Send commands until a message arrives in the pipe; answer it with the lateness of each."""
    with _OPENING:
        session = open_at(source.endpoint, "client", source.lease_s, source.security)
    token = session.liveliness().declare_token(TOKEN_KEY)
    publisher = session.declare_publisher(
        COMMAND_KEY,
        congestion_control=zenoh.CongestionControl.DROP,
        priority=zenoh.Priority.REAL_TIME,
        express=True,
        # Only the newest command is useful: over QUIC, it is a datagram, which is never sent again.
        reliability=zenoh.Reliability.BEST_EFFORT,
    )
    pipe.send("ready")
    stamper, payload = Stamper(), encode(planar_twist(CRUISE_M_S, 0.0))
    late: list[tuple[float, float]] = []
    # The flows of one process send at the same moments, so that one wake-up serves them all.
    period_s = 1.0 / COMMAND_HZ
    due_s = (math.ceil(time.monotonic() * COMMAND_HZ) + source.process * SPREAD % 1.0) * period_s
    while not pipe.poll():
        time.sleep(max(0.0, due_s - time.monotonic()))
        now_s = time.monotonic()
        publisher.put(payload, attachment=stamper.next().pack())
        late.append((due_s, now_s))
        due_s += period_s * max(1, math.ceil((now_s - due_s) / period_s))
    pipe.send(late)
    del token


def main() -> None:
    given = json.loads(sys.stdin.readline())
    security = tls.settings(choose_bundle(Path(given["keys"]), time.time(), part=None))
    together: int = given["together"]
    sources = [
        Source(number // together, security=security, **one) for number, one in enumerate(given["sources"])
    ]
    pipes = fork_each(sources, send, together)
    for pipe in pipes:
        pipe.recv()
    print("ready", flush=True)
    if not sys.stdin.readline():
        os._exit(1)  # the process that started this one is dead
    for pipe in pipes:
        pipe.send("end")
    late = Lateness()
    for pipe in pipes:
        for due_s, at_s in pipe.recv():
            late.add(due_s, at_s)
    print(json.dumps(late.report()), flush=True)


if __name__ == "__main__":
    main()
