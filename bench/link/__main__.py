"""`python -m bench.link`: measure false stops over links that lose packets. Exit 0, or 1 if a program fails."""

import argparse
import os
import sys
from pathlib import Path

from bench.link.results import LOSSES, ROUND_TRIPS_S, Link, Results, grid, read, sheets, verdicts, write
from bench.link.run import Plan, measure
from bench.rig.options import (
    CommandLine,
    at_least_zero,
    count,
    failing_in_a_sentence,
    percent,
    positive,
    progress,
    seed,
)
from bench.rig.sheet import show
from bench.rig.stored import this_run
from wire.bus_config import BusConfig

FLOWS = 2
SECONDS = 200.0
LATE_MS = 5.0


def main() -> None:
    line = CommandLine(
        "bench.link",
        "Measure false stops per hour of commands at 20 Hz, and their worst age, over links that lose, delay and reorder packets: "
        "TCP, QUIC with mutual TLS and datagrams, and UDP. All conditions run at once, each with several flows, between two "
        "network namespaces with a router in user space. Needs root. Takes about four minutes for each round.",
        "exit code: 0, even if a target is missed; 1 if a program fails or a round is rejected",
    )
    line.option("links", Link, list(Link), "transports of the commands: tcp, quic, udp", many=True)
    line.option("loss-percent", percent, [100 * one for one in LOSSES], "loss in each direction", many=True)
    line.option(
        "round-trip-ms", at_least_zero, [1000 * one for one in ROUND_TRIPS_S], "without jitter", many=True
    )
    line.option(
        "lease-s", positive, [BusConfig().lease_s], "time after which a silent link counts as dead", many=True
    )
    line.option("flows", count, FLOWS, "flows of each condition")
    line.option("together", count, 1, "flows that share a process, to measure more of them on one machine")
    line.option("seconds", positive, SECONDS, "duration of each round")
    line.option("rounds", count, 1, "number of rounds")
    line.option("seed", seed, 1, "seed of the first round")
    line.option(
        "late-ms", positive, LATE_MS, "reject a round if a part of the bench exceeds this p99 lateness"
    )
    line.file("json", "add the results to the JSON lines in FILE")
    options = line.parse()
    kept = "the complete rounds are in the file" if options.json is not None else "nothing was written"
    with failing_in_a_sentence("bench.link", kept):
        _measure(options, f"{_priority()}{line.repeat(options)}")


def _priority() -> str:
    """Return the command that gave this process its real-time priority; empty if it has none."""
    option = {os.SCHED_FIFO: "-f", os.SCHED_RR: "-r"}.get(os.sched_getscheduler(0))
    return "" if option is None else f"chrt {option} {os.sched_getparam(0).sched_priority} "


def _measure(options: argparse.Namespace, command: str) -> None:
    losses = [one / 100 for one in options.loss_percent]
    round_trips_s = [one / 1000 for one in options.round_trip_ms]
    conditions = grid(options.links, losses, round_trips_s, options.lease_s)
    file: Path | None = options.json
    results = Results({}, (), ()) if file is None or not file.exists() else read(file)
    rejected = 0
    for number in range(options.rounds):
        seed_of_round: int = options.seed + number
        plan = Plan(conditions, options.flows, options.seconds, seed_of_round, options.together)
        made, measured = measure(plan)
        rejection = made.rejection(options.late_ms)
        if rejection is not None:
            rejected += 1
            progress(f"round {number + 1} is rejected: {rejection}")
            continue
        results = Results(this_run(command), (*results.rounds, made), (*results.measured, *measured))
        if file is not None:
            write(results, file)
    if results.rounds:
        show(sheets(results), verdicts(results), results.run)
    sys.exit(int(rejected > 0))


if __name__ == "__main__":
    main()
