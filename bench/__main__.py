"""`python -m bench`: run the benchmarks, print the results, and write them to files."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from bench import heartbeat, law, process, sim, start
from bench.peers import results as peers
from bench.rig.options import CommandLine, failing_in_a_sentence, progress
from bench.rig.sheet import Sheet, Verdict, show, write_markdown
from bench.rig.stored import rows_of, this_run, write_rows
from bench.robots import results as robots

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


class Part(NamedTuple):
    """A benchmark: its measurement, its table and its verdicts."""

    measure: Callable[[], Sequence[Any]]
    sheet: Callable[[Sequence[Any]], Sheet]
    verdicts: Callable[[Sequence[Any]], list[Verdict]] = lambda _: []


PARTS: dict[str, Part] = {
    "step": Part(law.time_steps, law.timing_sheet, law.verdicts),
    "memory": Part(law.measure_memory, law.memory_sheet),
    "process": Part(process.measure_process, process.load_sheet, process.verdicts),
    "heartbeat": Part(heartbeat.measure_heartbeats, heartbeat.heartbeat_sheet, heartbeat.verdicts),
    "sim": Part(sim.measure_pace, sim.pace_sheet, sim.verdicts),
    "import": Part(start.measure_imports, start.imports_sheet),
    "start": Part(start.measure_starts, start.starts_sheet, start.verdicts),
}
"""The benchmarks by their names in the JSON lines."""


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
        choices=tuple(PARTS),
        default=tuple(PARTS),
        metavar="PART",
        help=f"measure only these: {', '.join(PARTS)}",
    )
    line.file("json", "write the results as JSON lines")
    line.file("markdown", "write the results as a markdown document")
    options = line.parse()
    if options.markdown is not None and set(options.only) != set(PARTS):
        line.parser.error("--markdown writes a document of all parts: leave out --only")
    measured: dict[str, Sequence[Any]] = {}
    with failing_in_a_sentence("bench"):
        # Runs of their own, which take longer; read first, so that a damaged file is noticed before the measurements.
        stored_peers, stored_robots = peers.read(), robots.read()
        for name in filter(options.only.__contains__, PARTS):
            progress(f"bench: {name}")
            measured[name] = PARTS[name].measure()
    sheets = [PARTS[name].sheet(found) for name, found in measured.items()]
    verdicts = [verdict for name, found in measured.items() for verdict in PARTS[name].verdicts(found)]
    show(sheets, verdicts)
    if options.json is not None:
        rows = [row for name, found in measured.items() for row in rows_of(name, found)]
        write_rows(options.json, this_run(line.repeat(options)), [*rows, *rows_of("target", verdicts)])
    if options.markdown is not None:
        sheets += peers.sheets(stored_peers) + robots.sheets(stored_robots)
        verdicts += peers.verdicts(stored_peers) + robots.verdicts(stored_robots)
        command = f"{line.repeat(options)} --markdown {options.markdown}"
        write_markdown(options.markdown, HEADING, command, sheets, verdicts)


if __name__ == "__main__":
    main()
