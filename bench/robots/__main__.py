"""`python -m bench.robots`: measure how many robots one machine can supervise. Exit 0, or 1 if a process fails."""

import argparse
import sys
from pathlib import Path

from bench.rig.options import count, duration_s, failing_in_a_sentence, output_file
from bench.rig.sheet import show
from bench.rig.stored import this_run
from bench.robots.results import Crowd, Robots, write
from bench.robots.run import measure
from bench.robots.table import sheets, verdicts

ROBOTS = [1, 5, 10, 20, 25, 30]
SECONDS = 20.0
KILLS = 40


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m bench.robots",
        description="Run several robots on this machine, a supervisor process for each, and measure processor time, gaps of "
        "cmd_vel, stops without cause, and the time from the SIGKILL of an operator to zero. Takes about six minutes.",
        epilog="exit code: 0, even if a target is missed; 1 if a process fails; 130 after Ctrl-C",
    )
    parser.add_argument(
        "--robots",
        type=count,
        nargs="+",
        default=ROBOTS,
        metavar="N",
        help=f"numbers of robots (default: {' '.join(map(str, ROBOTS))})",
    )
    parser.add_argument(
        "--seconds", type=duration_s, default=SECONDS, help="duration of each drive (default: %(default)s)"
    )
    parser.add_argument(
        "--kills", type=count, default=KILLS, help="kills for each number of robots (default: %(default)s)"
    )
    parser.add_argument("--json", type=output_file, metavar="FILE", help="write the results as JSON lines")
    options = parser.parse_args()

    def tell(text: str) -> None:
        print(text, file=sys.stderr, flush=True)

    command = (
        f"python -m bench.robots --robots {' '.join(map(str, options.robots))} --seconds {options.seconds:g} "
        f"--kills {options.kills}"
    )
    run, crowds = this_run(command), list[Crowd]()
    with failing_in_a_sentence("bench.robots"):
        try:
            for number in options.robots:
                crowds.append(measure(number, options.seconds, options.kills, tell))
        finally:
            if crowds:  # also those before a failure or Ctrl-C
                _report(Robots(run, tuple(crowds)), options.json)


def _report(robots: Robots, json_file: Path | None) -> None:
    if json_file is not None:
        write(robots, json_file)
    show(sheets(robots), verdicts(robots))


if __name__ == "__main__":
    main()
