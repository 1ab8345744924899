"""The command `lifeline grade`: its orders, its network, and the files that it writes."""

import json
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from pydantic import TypeAdapter, ValidationError
from rich.console import Console

from deploy.stack.errors import DeployError
from deploy.stack.takedown import Say
from faults.grade import report, rubric
from faults.grade.exam import Exam, grade
from faults.grade.robot import Setup
from faults.real.rig.cable import why_not
from faults.trial_file import provenance_of_this_command
from wire.foreign import read_text
from wire.host.config import Endpoint

MIN_WIDTH = 110
"""Width of the table in columns if the output is not a terminal."""
ISOLATED = "LIFELINE_ISOLATED"
"""The variable that is set inside the network namespace."""


@dataclass(frozen=True)
class Orders:
    """The options of the command."""

    command: tuple[str, ...]
    keys: str
    stop_key: str
    hold: bool
    ros2: bool
    lifeline: bool
    whole_group: bool
    timeout_s: float | None
    endpoint: str
    rubric: Path | None
    html: Path | None
    junit: Path | None
    json: Path | None

    def check(self) -> None:
        """Refuse orders that contradict each other.

        Raises:
            DeployError: they do.
        """
        if not self.command:
            raise DeployError(
                "there is no program to grade: give its command after --, such as -- python teleop.py"
            )
        if self.hold and not self.keys:
            raise DeployError("--hold needs --keys: name the key to hold")
        if self.lifeline and self.timeout_s is not None:
            raise DeployError("--base-timeout is for a robot alone: leave out --through-lifeline")
        try:
            TypeAdapter(Endpoint).validate_python(self.endpoint)
        except ValidationError as error:
            raise DeployError(f"--endpoint {self.endpoint}: {error.errors()[0]['msg']}") from error
        if not self.endpoint.startswith("tcp/"):
            raise DeployError("--endpoint must be tcp/HOST:PORT: the robot has no certificate")
        for path in (self.html, self.junit, self.json):
            if path is not None and not path.absolute().parent.is_dir():
                raise DeployError(f"the directory of {path} does not exist: create it first")


def default_rubric() -> str:
    return read_text(rubric.DEFAULT)


def run(orders: Orders, say: Say) -> int:
    """Grade the program, write the files, and print the table; return 0 if it passed, else 1.

    Raises:
        DeployError: the orders are invalid, the program could not be graded, or a file cannot be written.
    """
    orders.check()
    points = rubric.read(orders.rubric)
    if orders.ros2 and ISOLATED not in os.environ and why_not() is None:
        isolate()
    setup = Setup(
        endpoint=orders.endpoint,
        lifeline=orders.lifeline,
        timeout_s=orders.timeout_s,
        ros2=orders.ros2,
        hold=orders.hold,
    )
    exam = Exam(orders.command, setup, points, orders.keys, orders.stop_key, orders.whole_group)
    found = grade(exam, say)
    _write(orders.html, lambda: report.page(found))
    _write(orders.junit, lambda: report.junit(found))
    run_of = provenance_of_this_command().model_dump()
    _write(orders.json, lambda: json.dumps({"run": run_of, **report.as_json(found)}) + "\n")
    console = Console()
    if not console.is_terminal:
        console = Console(width=MIN_WIDTH)
    console.print(report.table(found))
    return int(not found.passed)


def isolate() -> NoReturn:
    """Replace this process by the same command in a network namespace, where a cable can be unplugged and nobody else hears its topics."""
    command = ["unshare", "--net", "sh", "-c", 'ip link set lo up && exec "$@"', "sh", *sys.orig_argv]
    sys.stdout.flush()
    os.execvpe(command[0], command, os.environ | {ISOLATED: "1"})  # noqa: S606 - no shell is needed


def _write(path: Path | None, text: Callable[[], str]) -> None:
    if path is None:
        return
    try:
        path.write_text(text())
    except OSError as error:
        raise DeployError(f"cannot write {path}: {error.strerror}") from error
