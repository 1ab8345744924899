"""`python -m bench`: run the benchmarks, print the results, and write them to files."""

import argparse
import sys
from collections.abc import Callable, Iterable
from typing import TypeVar

from bench.heartbeat import measure_heartbeats
from bench.law import measure_memory, time_steps
from bench.peers.results import read as read_peers
from bench.peers.table import sheets as peers_sheets
from bench.peers.table import verdicts as peers_verdicts
from bench.process import measure_process
from bench.report import Results, write_json
from bench.rig.options import count, duration_s, failing_in_a_sentence, output_file
from bench.rig.sheet import show, write_markdown
from bench.robots.results import read as read_robots
from bench.robots.table import sheets as robots_sheets
from bench.robots.table import verdicts as robots_verdicts
from bench.sim import measure_pace
from bench.start import measure_imports, measure_starts

ROUNDS = 200
SECONDS = 15.0
HEARTBEAT_SECONDS = 30.0
SIM_ROUNDS = 80
IMPORT_ROUNDS = 10
START_ROUNDS = 5
PARTS = ("step", "memory", "process", "heartbeat", "sim", "import", "start")
"""The kinds of measurements, by the names that they have in the JSON lines."""
HEADING = """# Benchmarks

Time and memory of the supervisor, lateness of teleop's heartbeat, speed of the simulated robot, and time to
start and restart; also, from longer runs of their own, the supervisor beside bare relays, and many robots on one machine.

p50 and p99: half of the values, and 99 % of them, are at most this. Each target is an upper limit. Most tables also contain a reference
from the same run that does less, such as a bare relay, plain numpy or MuJoCo alone. It shows how much of a time is due to this
machine and its libraries.

The longer runs are read from docs/campaign. To measure them again, run
`python -m bench.peers --json docs/campaign/bench_peers.jsonl` and
`python -m bench.robots --json docs/campaign/bench_robots.jsonl` first; `make docs` then draws the curve.
"""


Measured = TypeVar("Measured")


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m bench",
        description="Measure the supervisor's time and memory, the lateness of teleop's heartbeat, the speed of the "
        "simulation, and the time to start and restart. Takes about five minutes.",
        epilog="exit code: 0, even if a target is missed: these are benchmarks, not tests; 1 if a process fails; "
        "130 after Ctrl-C",
    )
    parser.add_argument(
        "--only",
        nargs="+",
        choices=PARTS,
        default=PARTS,
        metavar="PART",
        help=f"measure only these: {', '.join(PARTS)}",
    )
    parser.add_argument("--json", type=output_file, metavar="FILE", help="write the results as JSON lines")
    parser.add_argument(
        "--markdown", type=output_file, metavar="FILE", help="write the results as a markdown document"
    )
    parser.add_argument(
        "--rounds", type=count, default=ROUNDS, help="number of rounds for step() (default: %(default)s)"
    )
    parser.add_argument(
        "--seconds",
        type=duration_s,
        default=SECONDS,
        help="duration of each phase of the process benchmark (default: %(default)s)",
    )
    parser.add_argument(
        "--heartbeat-seconds",
        type=duration_s,
        default=HEARTBEAT_SECONDS,
        help="duration of each teleop run (default: %(default)s)",
    )
    parser.add_argument(
        "--sim-rounds",
        type=count,
        default=SIM_ROUNDS,
        help="number of simulated seconds for each scene (default: %(default)s)",
    )
    parser.add_argument(
        "--start-rounds",
        type=count,
        default=START_ROUNDS,
        help="number of starts, each with one restart (default: %(default)s)",
    )
    arguments = parser.parse_args()
    if arguments.markdown is not None and set(arguments.only) != set(PARTS):
        parser.error("--markdown writes a document of all parts: leave out --only")
    with failing_in_a_sentence("bench"):
        # Runs of their own, which take longer; read first, so that a damaged file is noticed before the measurements.
        peers, robots = read_peers(), read_robots()
        results = _measure(arguments)
    sheets, verdicts = results.sheets(), results.verdicts()
    show(sheets, verdicts)
    if peers is not None:
        sheets, verdicts = sheets + peers_sheets(peers), verdicts + peers_verdicts(peers)
    if robots is not None:
        sheets, verdicts = sheets + robots_sheets(robots), verdicts + robots_verdicts(robots)
    if arguments.json is not None:
        write_json(results, arguments.json)
    if arguments.markdown is not None:
        write_markdown(arguments.markdown, HEADING, _command(arguments), sheets, verdicts)


def _measure(arguments: argparse.Namespace) -> Results:
    def part(name: str, measure: Callable[[], Iterable[Measured]]) -> tuple[Measured, ...]:
        if name not in arguments.only:
            return ()
        print(f"bench: {name}", file=sys.stderr, flush=True)
        return tuple(measure())

    return Results(
        part("step", lambda: time_steps(arguments.rounds)),
        part("memory", measure_memory),
        part("process", lambda: measure_process(arguments.seconds)),
        part("heartbeat", lambda: measure_heartbeats(arguments.heartbeat_seconds)),
        part("sim", lambda: measure_pace(arguments.sim_rounds)),
        part("import", lambda: measure_imports(IMPORT_ROUNDS)),
        part("start", lambda: measure_starts(arguments.start_rounds)),
    )


def _command(arguments: argparse.Namespace) -> str:
    command = f"python -m bench --markdown {arguments.markdown}"
    if arguments.rounds != ROUNDS:
        command += f" --rounds {arguments.rounds}"
    if arguments.seconds != SECONDS:
        command += f" --seconds {arguments.seconds:g}"
    if arguments.heartbeat_seconds != HEARTBEAT_SECONDS:
        command += f" --heartbeat-seconds {arguments.heartbeat_seconds:g}"
    if arguments.sim_rounds != SIM_ROUNDS:
        command += f" --sim-rounds {arguments.sim_rounds}"
    if arguments.start_rounds != START_ROUNDS:
        command += f" --start-rounds {arguments.start_rounds}"
    return command


if __name__ == "__main__":
    main()
