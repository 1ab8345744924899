"""`python -m bench.fleet`: measure how many robots one router serves. Exit 0, or 1 if a process fails or a promise is broken."""

import argparse
import sys

from bench.fleet.layout import site
from bench.fleet.table import sheet, soak_verdicts
from bench.rig.options import count, duration_s, failing_in_a_sentence, output_file
from bench.rig.sheet import show
from bench.rig.stored import this_run
from bench.robots.results import Crowd, Robots, write
from bench.robots.run import KILLS_LIMIT_S, measure

ROBOTS = [1, 5, 10, 20, 50]
SECONDS, KILLS = 15.0, 30
SOAK_ROBOTS = 10
SOAK_DRIVE_S = 30.0
"""How long all robots of a long run drive before the kills begin."""


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m bench.fleet",
        description="Run several robots behind one router on this machine, with certificates on every link, and measure processor "
        "time, gaps of cmd_vel, stops without cause, and the time from the SIGKILL of an operator behind the router to zero. "
        "Takes about six minutes.",
        epilog="exit code: 0; 1 if a process fails, or if a promise is broken with --soak; 130 after Ctrl-C",
    )
    parser.add_argument(
        "--robots",
        type=count,
        nargs="+",
        metavar="N",
        help=f"numbers of robots (default: {' '.join(map(str, ROBOTS))}; with --soak: {SOAK_ROBOTS})",
    )
    parser.add_argument(
        "--seconds", type=duration_s, default=SECONDS, help="duration of each drive (default: %(default)s)"
    )
    parser.add_argument(
        "--kills", type=count, default=KILLS, help="kills for each number of robots (default: %(default)s)"
    )
    parser.add_argument(
        "--soak",
        type=duration_s,
        metavar="SECONDS",
        help="instead of the curve, drive for this time, kill operators all the while, and check every promise",
    )
    parser.add_argument("--json", type=output_file, metavar="FILE", help="write the results as JSON lines")
    options = parser.parse_args()
    robots: list[int] = options.robots or ([SOAK_ROBOTS] if options.soak else ROBOTS)

    def tell(text: str) -> None:
        print(text, file=sys.stderr, flush=True)

    def run(number: int) -> Crowd:
        with site(number) as layout:
            if options.soak is None:
                return measure(
                    number, options.seconds, options.kills, tell, layout, kills_limit_s=KILLS_LIMIT_S
                )
            drive_s = min(SOAK_DRIVE_S, options.soak / 2)
            return measure(number, drive_s, None, tell, layout, kills_limit_s=options.soak - drive_s)

    words = ["--robots", *map(str, robots)]
    words += ["--soak", f"{options.soak:g}"] if options.soak else ["--seconds", f"{options.seconds:g}"]
    words += [] if options.soak else ["--kills", str(options.kills)]
    crowds: list[Crowd] = []
    with failing_in_a_sentence("bench.fleet"):
        for number in robots:
            crowds.append(run(number))
            if options.json is not None:  # an interrupted run keeps what it has measured
                write(
                    Robots(this_run(f"python -m bench.fleet {' '.join(words)}"), tuple(crowds)), options.json
                )
    verdicts = [verdict for one in crowds for verdict in soak_verdicts(one)] if options.soak else []
    show([sheet(crowds)], verdicts)
    sys.exit(any(verdict.measured > verdict.target for verdict in verdicts))


if __name__ == "__main__":
    main()
