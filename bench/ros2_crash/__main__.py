"""`python -m bench.ros2_crash`: run the trials that the file does not contain yet, and print the table."""

import argparse
import itertools
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator
from pathlib import Path

import pexpect

from bench.rig.options import (
    CommandLine,
    count,
    failing_in_a_sentence,
    output_file,
    positive,
    progress,
    seed,
    unwind_at_sigterm,
)
from bench.ros2_crash.stage import program_of, run, stage
from bench.ros2_crash.trial import (
    Case,
    Fault,
    Setup,
    Teleop,
    Trial,
    appending,
    cases,
    markdown,
    missing,
    read,
    rows,
)

TRIALS = 20
INSIDE = "LIFELINE_ISOLATED"
"""The variable that is set inside the network namespace."""


def main() -> None:
    line = CommandLine(
        "bench.ros2_crash",
        "Kill, stop and unplug a keyboard node that drives a ROS 2 robot at 0.5 m/s, and measure time and "
        "distance to standstill. Needs `make ros2`; teleop_twist_keyboard is tried if it is installed, or if "
        "LIFELINE_TELEOP_TWIST_KEYBOARD names its file. Unplugging needs root.",
        "exit code: 0; 1 if a trial could not run. The file is extended: an interrupted run can be resumed",
    )
    line.parser.add_argument(
        "--out", type=output_file, required=True, metavar="FILE", help="JSON lines: one for each trial"
    )
    line.option("trials", count, TRIALS, "number of trials of each case")
    line.option("minutes", positive, float("inf"), "begin no trial after this many minutes")
    line.parser.add_argument(
        "--lifeline",
        choices=("no", "yes", "both"),
        default="both",
        help="run the trials with Lifeline, without it, or both (default: %(default)s)",
    )
    line.option("seed", seed, 1, "seed of the times of the faults")
    options = line.parse()
    if not is_isolated() and can_isolate():
        isolate()
    unwind_at_sigterm()
    with failing_in_a_sentence("bench.ros2_crash", "the complete trials are in the file"):
        sys.exit(measure(options))


def is_isolated() -> bool:
    return INSIDE in os.environ


def can_isolate() -> bool:
    """Return whether this process may create network namespaces."""
    if not (shutil.which("unshare") and shutil.which("ip")):
        return False
    done = subprocess.run(["unshare", "--net", "true"], check=False, capture_output=True)
    return done.returncode == 0


def isolate() -> None:
    """Replace this process by the same command in a network namespace of its own."""
    again = [sys.executable, "-m", "bench.ros2_crash", *sys.argv[1:]]
    command = ["unshare", "--net", "sh", "-c", 'ip link set lo up && exec "$@"', "sh", *again]
    os.execvpe(command[0], command, os.environ | {INSIDE: "1"})


def measure(arguments: argparse.Namespace) -> int:
    """Run what is missing, and print the table; return the exit code."""
    done, failed = read(arguments.out), 0
    lifeline = {"no": [False], "yes": [True], "both": [False, True]}[arguments.lifeline]
    faults = [fault for fault in Fault if fault is not Fault.UNPLUG or is_isolated()]
    wanted = cases([one for one in Teleop if program_of(one) is not None], faults, lifeline)
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
                    progress(f"not run: {setup}: {error}\n{last_words(Path(logs))}")
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


if __name__ == "__main__":
    main()
