"""`python -m bench`: measure the law, the supervisor process and its restart, each beside a reference of the same run."""

import argparse
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from bench import law, process, start
from bench.rig.options import CommandLine, failing_in_a_sentence, progress
from bench.rig.sheet import Sheet, Verdict, show
from bench.rig.stored import rows_of, this_run, write_rows


class Part(NamedTuple):
    """A benchmark: its measurement, the type of its rows, its table and its verdicts."""

    measure: Callable[[], Sequence[Any]]
    row: type[Any]
    sheet: Callable[[Sequence[Any]], Sheet]
    verdicts: Callable[[Sequence[Any]], list[Verdict]]


PARTS: dict[str, Part] = {
    "step": Part(law.time_steps, law.Timing, law.timing_sheet, law.verdicts),
    "process": Part(process.measure_process, process.Load, process.load_sheet, process.verdicts),
    "start": Part(start.measure_starts, start.Start, start.starts_sheet, start.verdicts),
}
"""The benchmarks by their names in the JSON lines."""


def _part(text: str) -> str:
    if text not in PARTS:
        raise argparse.ArgumentTypeError(f"must be one of {', '.join(PARTS)}, not {text!r}")
    return text


def main() -> None:
    line = CommandLine(
        "bench",
        "Measure the time of the law beside plain numpy, the supervisor process beside a bare relay, and its restart beside "
        "the import of its libraries. Takes about four minutes.",
        "exit code: 0, even if a target is missed: these are benchmarks, not tests; 1 if a process fails; 130 after Ctrl-C",
    )
    line.option("only", _part, list(PARTS), "measure only these", many=True)
    line.file("json", "write the results as JSON lines")
    options = line.parse()
    measured: dict[str, Sequence[Any]] = {}
    with failing_in_a_sentence("bench"):
        for name in filter(options.only.__contains__, PARTS):
            progress(f"bench: {name}")
            measured[name] = PARTS[name].measure()
    run = this_run(line.repeat(options))
    sheets = [PARTS[name].sheet(found) for name, found in measured.items()]
    show(sheets, [one for name, found in measured.items() for one in PARTS[name].verdicts(found)], run)
    if options.json is not None:
        rows = [row for name, found in measured.items() for row in rows_of(name, found, digits=4)]
        write_rows(options.json, run, rows)


if __name__ == "__main__":
    main()
