"""Both ends of all flows, each in a process of its own: `python -m bench.link.flows sender|receiver`, run by bench/link/run.py.

The first line of the standard input is JSON: endpoint and lease of each flow, the folder of the keys, and how many flows share a
process. Prints `ready` when all hubs listen, or all sources are connected. Then,

* the sender sends commands until the line `end`, and prints its lateness as a line of JSON;
* the receiver prints `fresh` when each flow has had a fresh command, or `silent` with the numbers of the flows that had none in
  time. At the line `begin` it begins to count stops. At `end` it prints flows, lateness and the measured time as a line of JSON.

By default, operators and robots share no threads with each other, as in reality. Flows in one process share its wake-ups, which cost
most of the processor time: several times as many flows then fit on a machine.
"""

import json
import math
import multiprocessing
import os
import sys
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Literal, TypeAlias

import zenoh

from bench.link.stops import Flow, Lateness
from bench.peers.links.zenoh_link import open_session
from bench.rig.feed import COMMAND_HZ, CRUISE_M_S, SPREAD
from bench.rig.program import die_with_parent
from wire import tls, topics
from wire.bundle import choose_bundle
from wire.bus_config import BusConfig
from wire.messages import encode, planar_twist
from wire.roles import Role
from wire.stamp import Stamper, parse_stamp
from wire.zenoh.connect import RECONNECT_MS, TX_QUEUE
from wire.zenoh.session import direct

RUNTIME = "(rx: (worker_threads: 1))"
"""Zenoh's threads of a process: a second receiving thread costs wake-ups, and no flow has more than 200 packets a second."""
PORT = 7447
"""Of the first flow of a condition; the others have the next ones."""
COMMAND_KEY = f"{BusConfig().namespace}/{topics.source_cmd_vel(topics.TELEOP).key}"
TOKEN_KEY = f"{BusConfig().namespace}/{topics.alive(topics.TELEOP)}"
NICE = -10
FRESH_LIMIT_S = 60.0
BEAT_S = 0.005
"""Period at which the receiver measures how late the machine lets it run."""
_OPENING = threading.Lock()
"""Held while a source connects: many simultaneous handshakes in one process would time out."""

Pipe: TypeAlias = "Connection[Any, Any]"


@dataclass(frozen=True)
class End:
    """One end of a flow: a command source, or a robot's hub."""

    process: int
    """Number of the process in which it runs."""
    endpoint: str
    """Endpoint of the hub."""
    lease_s: float
    security: dict[str, str | bool]
    """Zenoh's settings for mutual TLS (`wire.tls.settings`)."""

    def open(self, role: Literal["hub", "client"]) -> zenoh.Session:
        """Open a session that listens or connects, with the settings of the product, and mutual TLS for QUIC.

        Raises:
            zenoh.ZError: it cannot.
        """
        os.environ.setdefault("ZENOH_RUNTIME", RUNTIME)  # read once, when the first session is opened
        more: dict[str, object] = {
            "transport/link/tx/queue/size/real_time": TX_QUEUE,
            "transport/link/tls": self.security,
        }
        if role == "client":
            more["connect/timeout_ms"] = 20_000
            more["connect/retry"] = {
                "period_init_ms": RECONNECT_MS,
                "period_max_ms": RECONNECT_MS,
                "period_increase_factor": 1,
            }
        return open_session(self.endpoint, listens=role == "hub", lease_s=self.lease_s, more=more)


def fork_each(ends: Sequence[End], work: Callable[[End, Pipe], None], together: int) -> list[Pipe]:
    """Run `work` for each end, `together` ends in one process; return the parent's end of each pipe.

    The parent has imported all modules and opened no session, so that a fork is safe, and much cheaper than a new interpreter.
    The processes end with their work, or with this one.
    """
    forking = multiprocessing.get_context("fork")
    pipes: list[Pipe] = []

    def child(group: Sequence[End], theirs: Sequence[Pipe]) -> None:
        die_with_parent()
        threads = [threading.Thread(target=work, args=one) for one in zip(group, theirs, strict=True)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        for pipe in theirs:
            pipe.close()
        os._exit(0)  # closing a session can take seconds, and nobody needs it

    # Each of them stands for a computer of its own: other work of this one must not delay it.
    with suppress(PermissionError):
        os.setpriority(os.PRIO_PROCESS, 0, NICE)
    for first in range(0, len(ends), together):
        group = ends[first : first + together]
        ours, theirs = zip(*(forking.Pipe() for _ in group), strict=True)
        forking.Process(target=child, args=(group, theirs)).start()
        for pipe in theirs:
            pipe.close()
        pipes += ours
    return pipes


def send(source: End, pipe: Pipe) -> None:
    """Send commands until a message arrives in the pipe; answer it with the lateness of each."""
    with _OPENING:
        session = source.open("client")
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


def receive(hub: End, pipe: Pipe) -> None:
    """Judge the commands of one flow, as the messages in the pipe say."""
    flow, deletions = Flow(), 0

    def on_command(sample: zenoh.Sample) -> None:
        arrival_s = time.monotonic()
        stamp = parse_stamp(None if sample.attachment is None else sample.attachment.to_bytes())
        flow.hear(None if stamp is None else stamp.sent(), arrival_s)

    def on_token(sample: zenoh.Sample) -> None:
        nonlocal deletions
        deletions += sample.kind == zenoh.SampleKind.DELETE

    session = hub.open("hub")
    # A declaration exists only as long as it is referenced.
    declared = (
        session.declare_subscriber(COMMAND_KEY, direct(on_command)),
        session.liveliness().declare_subscriber(TOKEN_KEY, direct(on_token), history=True),
    )
    pipe.send("ready")
    until_s = time.monotonic() + FRESH_LIMIT_S
    while not flow.is_fresh and time.monotonic() < until_s:
        time.sleep(BEAT_S)
    pipe.send(flow.is_fresh)
    pipe.recv()
    flow.begin(time.monotonic())
    before = deletions
    pipe.recv()
    flow.end(time.monotonic())
    pipe.send(
        {
            "stops_s": flow.stops_s,
            "worst_age_s": flow.worst_age_s,
            "arrived": flow.arrived,
            "refused": flow.refused,
            "lost": deletions - before,
        }
    )
    del declared


def send_all(pipes: Sequence[Pipe]) -> dict[str, object]:
    """Return the lateness of all sources at the end of the input."""
    _next_line()
    _tell(pipes, "end")
    late = Lateness()
    for pipe in pipes:
        for due_s, at_s in pipe.recv():
            late.add(due_s, at_s)
    return {"late": late.report()}


def receive_all(pipes: Sequence[Pipe]) -> dict[str, object]:
    """Return the flows, and the lateness of this process, between the lines `begin` and `end`."""
    silent = [number for number, pipe in enumerate(pipes) if not pipe.recv()]
    print("silent" if silent else "fresh", *silent, flush=True)
    _next_line()
    ended, late = threading.Event(), Lateness()

    def wait_for_end() -> None:
        _next_line()
        ended.set()

    threading.Thread(target=wait_for_end, daemon=True).start()
    begin_s = time.monotonic()
    _tell(pipes, "begin")
    while not ended.is_set():
        due_s = time.monotonic() + BEAT_S
        time.sleep(BEAT_S)
        late.add(due_s, time.monotonic())
    _tell(pipes, "end")
    end_s = time.monotonic()
    return {"flows": [pipe.recv() for pipe in pipes], "late": late.report(), "window": (begin_s, end_s)}


def _tell(pipes: Sequence[Pipe], word: str) -> None:
    for pipe in pipes:
        pipe.send(word)


def _next_line() -> None:
    """Wait for the next command; end with the process that started this one."""
    if not sys.stdin.readline():
        os._exit(1)


def main() -> None:
    sends = sys.argv[1] == "sender"
    given = json.loads(sys.stdin.readline())
    part = None if sends else Role.SUPERVISOR
    security = tls.settings(choose_bundle(Path(given["keys"]), time.time(), part=part))
    together: int = given["together"]
    ends = [End(number // together, security=security, **one) for number, one in enumerate(given["flows"])]
    pipes = fork_each(ends, send if sends else receive, together)
    for pipe in pipes:
        pipe.recv()
    print("ready", flush=True)
    print(json.dumps(send_all(pipes) if sends else receive_all(pipes)), flush=True)


if __name__ == "__main__":
    main()
