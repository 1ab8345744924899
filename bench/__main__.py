"""`python -m bench`: run the benchmarks, print the results, and write them to files."""

import argparse
import sys
from collections.abc import Callable, Iterable
from typing import TypeVar

from bench.heartbeat import measure_heartbeats
from bench.law import measure_memory, time_steps
from bench.peers import results as peers
from bench.process import measure_process
from bench.report import Results, write_json
from bench.rig.options import CommandLine, count, duration_s, failing_in_a_sentence
from bench.rig.sheet import show, write_markdown
from bench.robots import results as robots
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
    line = CommandLine(
        "bench",
        "Measure the supervisor's time and memory, the lateness of teleop's heartbeat, the speed of the simulation, and the "
        "time to start and restart. Takes about five minutes.",
        "exit code: 0, even if a target is missed: these are benchmarks, not tests; 1 if a process fails; 130 after Ctrl-C",
    )
    line.parser.add_argument(
        "--only",
        nargs="+",
        choices=PARTS,
        default=PARTS,
        metavar="PART",
        help=f"measure only these: {', '.join(PARTS)}",
    )
    line.file("json", "write the results as JSON lines")
    line.file("markdown", "write the results as a markdown document")
    line.option("rounds", count, ROUNDS, "number of rounds for step()")
    line.option("seconds", duration_s, SECONDS, "duration of each phase of the process benchmark")
    line.option("heartbeat-seconds", duration_s, HEARTBEAT_SECONDS, "duration of each teleop run")
    line.option("sim-rounds", count, SIM_ROUNDS, "number of simulated seconds for each scene")
    line.option("start-rounds", count, START_ROUNDS, "number of starts, each with one restart")
    arguments = line.parse()
    if arguments.markdown is not None and set(arguments.only) != set(PARTS):
        line.parser.error("--markdown writes a document of all parts: leave out --only")
    with failing_in_a_sentence("bench"):
        # Runs of their own, which take longer; read first, so that a damaged file is noticed before the measurements.
        stored_peers, stored_robots = peers.read(), robots.read()
        results = _measure(arguments)
    sheets, verdicts = results.sheets(), results.verdicts()
    show(sheets, verdicts)
    if stored_peers is not None:
        sheets, verdicts = sheets + peers.sheets(stored_peers), verdicts + peers.verdicts(stored_peers)
    if stored_robots is not None:
        sheets, verdicts = sheets + robots.sheets(stored_robots), verdicts + robots.verdicts(stored_robots)
    if arguments.json is not None:
        write_json(results, arguments.json)
    if arguments.markdown is not None:
        command = f"{line.repeat(arguments)} --markdown {arguments.markdown}"
        write_markdown(arguments.markdown, HEADING, command, sheets, verdicts)


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


if __name__ == "__main__":
    main()
