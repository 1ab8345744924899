"""`python -m bench.ros2_crash`: run the trials that the file does not contain yet, and print the table."""

import itertools
import os
import random
import sys
import tempfile
from pathlib import Path
from typing import NoReturn

import pexpect

from bench.rig.options import (
    CommandLine,
    count,
    failing_in_a_sentence,
    output_file,
    progress,
)
from bench.rig.stored import provenance
from bench.ros2_crash.stage import program_of, run, stage
from bench.ros2_crash.trial import Fault, Teleop, cases, markdown, missing, read
from faults.real.rig.cable import why_not
from faults.trial_file import appending

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
    options = line.parse()
    if INSIDE not in os.environ and why_not() is None:
        isolate()
    with failing_in_a_sentence("bench.ros2_crash", "the complete trials are in the file"):
        sys.exit(measure(options.out, options.trials))


def isolate() -> NoReturn:
    """Replace this process by the same command in a network namespace of its own."""
    again = [sys.executable, "-m", "bench.ros2_crash", *sys.argv[1:]]
    command = ["unshare", "--net", "sh", "-c", 'ip link set lo up && exec "$@"', "sh", *again]
    os.execvpe(command[0], command, os.environ | {INSIDE: "1"})


def measure(out: Path, trials: int) -> int:
    """Run what is missing, and print the table; return the exit code."""
    done, failed = read(out), 0
    faults = [fault for fault in Fault if fault is not Fault.UNPLUG or INSIDE in os.environ]
    wanted = cases([one for one in Teleop if program_of(one) is not None], faults)
    todo = missing(wanted, trials, done)
    with appending(out, provenance("python -m bench.ros2_crash")) as append:
        for setup, block in itertools.groupby(todo, lambda one: one[0].setup):
            with tempfile.TemporaryDirectory() as logs:
                try:
                    # The trials of a block share the robot's processes.
                    with stage(setup, Path(logs)) as made:
                        for case, number in block:
                            trial = run(made, case, number, random.Random(f"{case} {number}"))
                            done.append(trial)
                            append(trial.line())
                            print(trial.line(), flush=True)
                except (AssertionError, pexpect.ExceptionPexpect) as error:
                    failed += 1
                    progress(f"not run: {setup}: {error}\n{last_words(Path(logs))}")
    print(markdown(done))
    return int(failed > 0)


def last_words(logs: Path) -> str:
    """Return the ends of the processes' logs."""
    return "\n".join(f"{path.name}: {path.read_text()[-600:]}" for path in sorted(logs.glob("*-*.log")))


if __name__ == "__main__":
    main()
