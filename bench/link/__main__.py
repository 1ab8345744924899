"""`python -m bench.link`: measure false stops over links that lose packets. Exit 0, or 1 if a program fails."""

import argparse
import os
import signal
import sys
from types import FrameType
from typing import NoReturn

from bench.link.conditions import LOSSES, ROUND_TRIPS_S, Link, grid
from bench.link.namespaces import NoNamespaceError
from bench.link.results import Results, read, write
from bench.link.run import Plan, measure
from bench.link.table import sheets, verdicts
from bench.rig.options import (
    at_least_zero,
    count,
    failing_in_a_sentence,
    output_file,
    percent,
    positive,
    seed,
)
from bench.rig.sheet import show
from bench.rig.stored import this_run
from wire.bus_config import BusConfig

FLOWS = 2
SECONDS = 200.0
LATE_MS = 5.0


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m bench.link",
        description="Measure false stops per hour of commands at 20 Hz, and their worst age, over links that lose, delay "
        "and reorder packets: TCP, QUIC with mutual TLS and datagrams, and UDP. All conditions run at once, each with "
        "several flows, between two network namespaces with a router in user space. Needs root. Takes about four "
        "minutes for each round.",
        epilog="exit code: 0, even if a target is missed; 1 if a program fails or a round is rejected",
    )
    parser.add_argument(
        "--links",
        type=Link,
        nargs="+",
        default=list(Link),
        metavar="LINK",
        help="tcp, quic, udp (default: all)",
    )
    parser.add_argument(
        "--loss-percent",
        type=percent,
        nargs="+",
        default=[100 * one for one in LOSSES],
        metavar="P",
        help="packets lost, each way (default: 0 1 2 3 5 10)",
    )
    parser.add_argument(
        "--round-trip-ms",
        type=at_least_zero,
        nargs="+",
        default=[1000 * one for one in ROUND_TRIPS_S],
        metavar="T",
        help="without jitter (default: 0 20 100 300)",
    )
    parser.add_argument(
        "--lease-s",
        type=positive,
        nargs="+",
        default=[BusConfig().lease_s],
        metavar="S",
        help=f"how long a silent link counts as alive (default: {BusConfig().lease_s:g})",
    )
    parser.add_argument(
        "--flows",
        type=count,
        default=FLOWS,
        metavar="N",
        help="flows of each condition (default: %(default)s)",
    )
    parser.add_argument(
        "--together",
        type=count,
        default=1,
        metavar="N",
        help="flows that share a process, to measure more of them on one machine (default: %(default)s)",
    )
    parser.add_argument(
        "--seconds", type=positive, default=SECONDS, help="duration of each round (default: %(default)s)"
    )
    parser.add_argument("--rounds", type=count, default=1, metavar="N", help="(default: %(default)s)")
    parser.add_argument("--seed", type=seed, default=1, help="seed of the first round (default: %(default)s)")
    parser.add_argument(
        "--late-ms",
        type=positive,
        default=LATE_MS,
        metavar="T",
        help="reject a round in which a part of the bench is later than this, p99 (default: %(default)g)",
    )
    parser.add_argument(
        "--json", type=output_file, metavar="FILE", help="add the results to the JSON lines in FILE"
    )
    options = parser.parse_args()
    signal.signal(signal.SIGTERM, _end)
    kept = "the complete rounds are in the file" if options.json is not None else "nothing was written"
    with failing_in_a_sentence("bench.link", kept):
        try:
            _measure(options)
        except NoNamespaceError as error:
            raise RuntimeError(str(error)) from error


def _end(_: int, __: FrameType | None) -> NoReturn:
    """End the programs and remove the namespaces, then end this process."""
    sys.exit(143)


def _priority() -> str:
    """Return the command that gave this process its real-time priority; empty if it has none."""
    option = {os.SCHED_FIFO: "-f", os.SCHED_RR: "-r"}.get(os.sched_getscheduler(0))
    return "" if option is None else f"chrt {option} {os.sched_getparam(0).sched_priority} "


def _measure(options: argparse.Namespace) -> None:
    conditions = grid(
        options.links,
        [one / 100 for one in options.loss_percent],
        [one / 1000 for one in options.round_trip_ms],
        options.lease_s,
    )
    words = [f"{_priority()}python -m bench.link"]
    if options.links != list(Link):
        words.append(f"--links {' '.join(options.links)}")
    together = f" --together {options.together}" if options.together > 1 else ""
    words += [
        f"--loss-percent {' '.join(f'{one:g}' for one in options.loss_percent)}",
        f"--round-trip-ms {' '.join(f'{one:g}' for one in options.round_trip_ms)}",
        f"--lease-s {' '.join(f'{one:g}' for one in options.lease_s)}",
        f"--flows {options.flows}{together} --seconds {options.seconds:g} --rounds {options.rounds} --seed {options.seed}",
    ]
    before = None if options.json is None else read(options.json)
    results = before or Results({}, (), ())
    rejected = 0
    for number in range(options.rounds):
        flows: int = options.flows
        plan = Plan(
            dict.fromkeys(conditions, flows), options.seconds, options.seed + number, options.together
        )
        made, measured = measure(plan)
        rejection = made.rejection(options.late_ms)
        if rejection is not None:
            rejected += 1
            print(f"round {number + 1} is rejected: {rejection}", file=sys.stderr, flush=True)
            continue
        results = Results(this_run(" ".join(words)), (*results.rounds, made), (*results.measured, *measured))
        if options.json is not None:
            write(results, options.json)
    if results.rounds:
        show(sheets(results), verdicts(results))
    sys.exit(int(rejected > 0))


if __name__ == "__main__":
    main()
