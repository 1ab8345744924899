"""`python -m bench.ros2_crash`: run the trials that the file does not contain yet, and print the table."""

import argparse
import itertools
import random
import signal
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import FrameType
from typing import NoReturn

import pexpect

from bench.rig.options import count, failing_in_a_sentence, output_file, positive, seed
from bench.ros2_crash.isolation import can_isolate, is_isolated, isolate
from bench.ros2_crash.results import appending, read
from bench.ros2_crash.run import run
from bench.ros2_crash.stage import program_of, stage
from bench.ros2_crash.table import markdown, rows
from bench.ros2_crash.trial import Case, Fault, Setup, Teleop, Trial, cases, missing
from deploy.stack.errors import DeployError

TRIALS = 20


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m bench.ros2_crash",
        description="Kill, stop and unplug a keyboard node that drives a ROS 2 robot at 0.5 m/s, and measure time and "
        "distance to standstill. Needs `make ros2`; teleop_twist_keyboard is tried if it is installed, or if "
        "LIFELINE_TELEOP_TWIST_KEYBOARD names its file. Unplugging needs root.",
        epilog="exit code: 0; 1 if a trial could not run. The file is extended: an interrupted run can be resumed",
    )
    parser.add_argument(
        "--out", type=output_file, required=True, metavar="FILE", help="JSON lines: one for each trial"
    )
    parser.add_argument(
        "--trials", type=count, default=TRIALS, help="number of trials of each case (default: %(default)s)"
    )
    parser.add_argument(
        "--minutes",
        type=positive,
        default=float("inf"),
        help="begin no trial after this many minutes (default: no limit)",
    )
    parser.add_argument(
        "--lifeline",
        choices=("no", "yes", "both"),
        default="both",
        help="whether Lifeline is between the node and the robot (default: %(default)s)",
    )
    parser.add_argument(
        "--seed", type=seed, default=1, help="seed of the times of the faults (default: %(default)s)"
    )
    arguments = parser.parse_args()
    if not is_isolated() and can_isolate():
        isolate()
    signal.signal(signal.SIGTERM, _end)
    with failing_in_a_sentence("bench.ros2_crash", "the complete trials are in the file"):
        try:
            sys.exit(measure(arguments))
        except DeployError as error:
            raise RuntimeError(str(error)) from error


def _end(_: int, __: FrameType | None) -> NoReturn:
    """End the trial's processes, then this one."""
    sys.exit(1)


def measure(arguments: argparse.Namespace) -> int:
    """Run what is missing, and print the table; return the exit code."""
    done, failed = read(arguments.out), 0
    lifeline = {"no": [False], "yes": [True], "both": [False, True]}[arguments.lifeline]
    wanted = cases([one for one in Teleop if program_of(one) is not None], _faults(), lifeline)
    end_s = time.monotonic() + 60 * arguments.minutes
    todo = missing(wanted, arguments.trials, done)
    with appending(arguments.out) as file:
        for setup, trials in itertools.groupby(todo, lambda one: one[0].setup):
            if time.monotonic() > end_s:
                break
            with tempfile.TemporaryDirectory() as logs:
                try:
                    for trial in run_block(setup, trials, Path(logs), arguments.seed, end_s):
                        done.append(trial)
                        file.write(trial.line() + "\n")
                        file.flush()
                        print(trial.line(), flush=True)
                except (AssertionError, TimeoutError, pexpect.ExceptionPexpect) as error:
                    failed += 1
                    print(f"not run: {setup}: {error}\n{last_words(Path(logs))}", file=sys.stderr, flush=True)
    print(markdown(rows(done)))
    return int(failed > 0)


def run_block(
    setup: Setup, trials: Iterable[tuple[Case, int]], logs: Path, number_of_seed: int, end_s: float
) -> Iterator[Trial]:
    """Run trials one after the other with the same processes of the robot.

    Raises:
        AssertionError: a process does not start, or the robot does not drive.
    """
    with stage(setup, logs) as made:
        for case, number in trials:
            if time.monotonic() > end_s:
                return
            yield run(made, case, number, random.Random(f"{number_of_seed} {case} {number}"))


def last_words(logs: Path) -> str:
    """Return the ends of the processes' logs."""
    return "\n".join(f"{path.name}: {path.read_text()[-600:]}" for path in sorted(logs.glob("*-*.log")))


def _faults() -> list[Fault]:
    return [fault for fault in Fault if fault is not Fault.UNPLUG or is_isolated()]


if __name__ == "__main__":
    main()
