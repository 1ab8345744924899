"""Receives the commands of all flows, each in a process of its own, and counts the stops: `python -m bench.link.receiver`.

bench/link/run.py starts it. The first line of the standard input is JSON: endpoint and lease of each flow's hub, and the folder of the
keys. Prints `ready` when all hubs listen, and `fresh` when each flow has had a fresh command, or `silent` with the numbers of the flows
that had none in time. Each further line is a command:

    begin     count from now on
    end       print flows, lateness and the measured time as a line of JSON, and end
"""

import json
import os
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path

import zenoh

from bench.link.children import Pipe, fork_each
from bench.link.lateness import Lateness
from bench.link.sessions import COMMAND_KEY, TOKEN_KEY, Security, open_at
from bench.link.stops import Flow
from wire import tls
from wire.bundle import choose_bundle
from wire.roles import Role
from wire.stamp import parse_stamp

FRESH_LIMIT_S = 60.0
BEAT_S = 0.005
"""Period at which the program measures how late the machine lets it run."""


@dataclass(frozen=True)
class Hub:
    """A robot's hub."""

    endpoint: str
    lease_s: float
    security: Security


def receive(hub: Hub, pipe: Pipe) -> None:
    """Judge the commands of one flow, as the messages in the pipe say."""
    flow, deletions = Flow(), 0

    def on_command(sample: zenoh.Sample) -> None:
        arrival_s = time.monotonic()
        stamp = parse_stamp(None if sample.attachment is None else sample.attachment.to_bytes())
        flow.hear(None if stamp is None else stamp.sent(), arrival_s)

    def on_token(sample: zenoh.Sample) -> None:
        nonlocal deletions
        deletions += sample.kind == zenoh.SampleKind.DELETE

    session = open_at(hub.endpoint, "hub", hub.lease_s, hub.security)
    # A declaration exists only as long as it is referenced.
    declared = (
        session.declare_subscriber(COMMAND_KEY, zenoh.handlers.Callback(on_command, indirect=False)),
        session.liveliness().declare_subscriber(
            TOKEN_KEY, zenoh.handlers.Callback(on_token, indirect=False), history=True
        ),
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


def main() -> None:
    given = json.loads(sys.stdin.readline())
    security = tls.settings(choose_bundle(Path(given["keys"]), time.time(), part=Role.SUPERVISOR))
    pipes = fork_each([Hub(**one, security=security) for one in given["hubs"]], receive, given["together"])
    for pipe in pipes:
        pipe.recv()
    print("ready", flush=True)
    silent = [number for number, pipe in enumerate(pipes) if not pipe.recv()]
    print("silent" if silent else "fresh", *silent, flush=True)
    begun, ended = threading.Event(), threading.Event()

    def read_commands() -> None:
        for event in (begun, ended):
            if not sys.stdin.readline():
                os._exit(1)  # the process that started this one is dead
            event.set()

    threading.Thread(target=read_commands, daemon=True).start()
    begun.wait()
    begin_s = time.monotonic()
    for pipe in pipes:
        pipe.send("begin")
    late = _beat(ended)
    for pipe in pipes:
        pipe.send("end")
    end_s = time.monotonic()
    flows = [pipe.recv() for pipe in pipes]
    print(json.dumps({"flows": flows, "late": late.report(), "window": (begin_s, end_s)}), flush=True)


def _beat(ended: threading.Event) -> Lateness:
    """Measure the lateness of this process until `ended` is set."""
    late = Lateness()
    while not ended.is_set():
        due_s = time.monotonic() + BEAT_S
        time.sleep(BEAT_S)
        late.add(due_s, time.monotonic())
    return late


if __name__ == "__main__":
    main()
