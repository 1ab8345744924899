"""`python -m bench.robots`: measure how many robots one machine can supervise. Exit 0, or 1 if a process fails."""

from bench.rig.options import CommandLine, count, failing_in_a_sentence, positive
from bench.rig.sheet import show
from bench.rig.stored import this_run
from bench.robots.results import Crowd, Robots, sheets, verdicts, write
from bench.robots.run import measure

ROBOTS = [1, 5, 10, 20, 25, 30]
SECONDS, KILLS = 20.0, 40


def main() -> None:
    line = CommandLine(
        "bench.robots",
        "Run several robots on this machine, a supervisor process for each, and measure processor time, gaps of "
        "cmd_vel, stops without cause, and the time from the SIGKILL of an operator to zero. Takes about six minutes.",
        "exit code: 0, even if a target is missed; 1 if a process fails; 130 after Ctrl-C",
    )
    line.option("robots", count, ROBOTS, "numbers of robots", many=True)
    line.option("seconds", positive, SECONDS, "duration of each drive")
    line.option("kills", count, KILLS, "kills for each number of robots")
    line.file("json", "write the results as JSON lines")
    options = line.parse()
    run, crowds = this_run(line.repeat(options)), list[Crowd]()
    with failing_in_a_sentence("bench.robots"):
        try:
            for number in options.robots:
                crowds.append(measure(number, options.seconds, options.kills))
        finally:
            if crowds:  # also those before a failure or Ctrl-C
                robots = Robots(run, tuple(crowds))
                if options.json is not None:
                    write(robots, options.json)
                show(sheets(robots), verdicts(robots))


if __name__ == "__main__":
    main()
