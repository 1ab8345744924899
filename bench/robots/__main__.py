"""`python -m bench.robots`: measure how many robots one machine can supervise, or with `--router`, how many one router serves."""

import sys
from contextlib import nullcontext

from bench.rig.options import CommandLine, count, failing_in_a_sentence, positive
from bench.rig.sheet import Verdict, show
from bench.rig.stored import this_run, was_idle
from bench.robots.results import Crowd, Robots, promises, sheet, write
from bench.robots.run import KILLS_LIMIT_S, measure
from bench.robots.site import site

ROBOTS = [1, 5, 10, 20, 25, 30]
SECONDS, KILLS = 20.0, 40
SOAK_DRIVE_S = 30.0
"""How long all robots of a long run drive before the kills begin."""


def main() -> None:
    line = CommandLine(
        "bench.robots",
        "Run several robots on this machine, a supervisor process for each, and measure processor time, gaps of "
        "cmd_vel, stops without cause, and the time from the SIGKILL of an operator to zero. Takes about six minutes.",
        "exit code: 0; 1 if a process fails, or if a promise is broken with --soak; 130 after Ctrl-C",
    )
    line.option("robots", count, ROBOTS, "numbers of robots", many=True)
    line.option("seconds", positive, SECONDS, "duration of each drive, without --soak")
    line.option("kills", count, KILLS, "kills for each number of robots, without --soak")
    line.option(
        "soak",
        positive,
        None,
        "drive for this time [s] with each number, kill operators throughout, and check every promise",
    )
    line.flag("router", "let operators and hubs connect to a router, with certificates on every link")
    line.file("json", "write the results as JSON lines")
    options = line.parse()
    drive_s, kills_limit_s = options.seconds, KILLS_LIMIT_S
    if options.soak is not None:
        options.seconds = options.kills = None
        drive_s = min(SOAK_DRIVE_S, options.soak / 2)
        kills_limit_s = options.soak - drive_s
    robots, verdicts = Robots({}, ()), list[Verdict]()
    with failing_in_a_sentence("bench.robots"):
        try:
            for number in options.robots:
                with site(number) if options.router else nullcontext() as made:
                    crowd: Crowd = measure(number, drive_s, options.kills, made, kills_limit_s=kills_limit_s)
                robots = Robots(this_run(line.repeat(options)), (*robots.crowds, crowd))
        finally:
            if robots.crowds:  # also those before a failure or Ctrl-C
                if options.json is not None:
                    write(robots, options.json)
                if options.soak is not None:
                    verdicts = [one for crowd in robots.crowds for one in promises(crowd)]
                show([sheet(robots)], verdicts, robots.run)
    sys.exit(was_idle(robots.run) and any(one.measured > one.target for one in verdicts))


if __name__ == "__main__":
    main()
