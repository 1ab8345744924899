"""`python -m bench`: run the benchmarks, print the results, and write them to files. Always exit 0."""

import argparse
from pathlib import Path

from bench.heartbeat import measure_heartbeats
from bench.law import measure_memory, time_steps
from bench.peers.results import read as read_peers
from bench.peers.table import sheets as peers_sheets
from bench.peers.table import verdicts as peers_verdicts
from bench.process import measure_process
from bench.report import Results, write_json
from bench.rig.sheet import show, write_markdown
from bench.robots.results import read as read_robots
from bench.robots.table import sheets as robots_sheets
from bench.robots.table import verdicts as robots_verdicts
from bench.sim import measure_pace
from bench.start import measure_imports, measure_starts
from bench.wakeup import measure_wakeup

ROUNDS = 200
SECONDS = 15.0
HEARTBEAT_SECONDS = 30.0
SIM_ROUNDS = 80
IMPORT_ROUNDS = 10
START_ROUNDS = 5
HEADING = """# Benchmarks

Time and memory of the supervisor, lateness of teleop's heartbeat, speed of the simulated robot, and time to
start and restart."""


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m bench",
        description="Measure the supervisor's time and memory, the lateness of teleop's heartbeat, the speed of the "
        "simulation, and the time to start and restart. Takes about five minutes.",
        epilog="exit code: always 0, even if a target is missed: these are benchmarks, not tests",
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the results as JSON lines")
    parser.add_argument(
        "--markdown", type=Path, metavar="FILE", help="write the results as a markdown document"
    )
    parser.add_argument(
        "--rounds", type=int, default=ROUNDS, help="number of rounds for step() (default: %(default)s)"
    )
    parser.add_argument(
        "--seconds",
        type=float,
        default=SECONDS,
        help="duration of each phase of the process benchmark (default: %(default)s)",
    )
    parser.add_argument(
        "--heartbeat-seconds",
        type=float,
        default=HEARTBEAT_SECONDS,
        help="duration of each teleop run (default: %(default)s)",
    )
    parser.add_argument(
        "--sim-rounds",
        type=int,
        default=SIM_ROUNDS,
        help="number of simulated seconds for each scene (default: %(default)s)",
    )
    parser.add_argument(
        "--start-rounds",
        type=int,
        default=START_ROUNDS,
        help="number of starts, each with one restart (default: %(default)s)",
    )
    arguments = parser.parse_args()
    results = Results(
        tuple(time_steps(arguments.rounds)),
        tuple(measure_memory()),
        tuple(measure_process(arguments.seconds)),
        tuple(measure_heartbeats(arguments.heartbeat_seconds)),
        tuple(measure_pace(arguments.sim_rounds)),
        tuple(measure_wakeup()),
        tuple(measure_imports(IMPORT_ROUNDS)),
        tuple(measure_starts(arguments.start_rounds)),
    )
    sheets, verdicts = results.sheets(), results.verdicts()
    show(sheets, verdicts)
    # Runs of their own, which take longer.
    if (peers := read_peers()) is not None:
        sheets, verdicts = sheets + peers_sheets(peers), verdicts + peers_verdicts(peers)
    if (robots := read_robots()) is not None:
        sheets, verdicts = sheets + robots_sheets(robots), verdicts + robots_verdicts(robots)
    if arguments.json is not None:
        write_json(results, arguments.json)
    if arguments.markdown is not None:
        write_markdown(arguments.markdown, HEADING, _command(arguments), sheets, verdicts)


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
