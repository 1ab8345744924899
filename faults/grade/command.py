"""The command `lifeline grade`: what it refuses, its network, and the files that it writes."""

import json
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple, NoReturn

from pydantic import TypeAdapter, ValidationError

from deploy.stack.console import show
from deploy.stack.errors import DeployError
from deploy.stack.takedown import Say
from faults.grade import report
from faults.grade.exam import Exam, grade
from faults.real.rig.cable import why_not
from faults.trial_file import provenance_of_this_command
from wire import tls
from wire.host.config import Endpoint

MAX_KEYS = 40
ISOLATED = "LIFELINE_ISOLATED"
"""The variable that is set inside the network namespace."""


class Files(NamedTuple):
    """What the command writes."""

    html: Path | None
    junit: Path | None
    json: Path | None


def check(exam: Exam, files: Files) -> None:
    """Refuse orders that contradict each other or cannot be followed.

    Raises:
        DeployError: they are refused.
    """
    setup = exam.setup
    if not exam.command:
        raise DeployError(
            "there is no program to grade: give its command after --, such as -- python teleop.py"
        )
    if setup.hold and not exam.keys:
        raise DeployError("--hold needs --keys: name the key to hold")
    if max(len(exam.keys), len(exam.stop_key)) > MAX_KEYS:
        raise DeployError(f"--keys and --stop-key have at most {MAX_KEYS} keys")
    if setup.lifeline and setup.timeout_s is not None:
        raise DeployError("--base-timeout is for a robot alone: leave out --through-lifeline")
    try:
        TypeAdapter(Endpoint).validate_python(setup.endpoint)
    except ValidationError as error:
        raise DeployError(f"--endpoint {setup.endpoint}: {error.errors()[0]['msg']}") from error
    if not (setup.endpoint.startswith("tcp/") and tls.is_loopback(setup.endpoint)):
        raise DeployError(
            "--endpoint must be of this machine, such as tcp/127.0.0.1:7448: it has no certificate"
        )
    for path in files:
        if path is not None and not path.absolute().parent.is_dir():
            raise DeployError(f"the directory of {path} does not exist: create it first")


def run(exam: Exam, files: Files, say: Say) -> int:
    """Grade the program, write the files, and print the table; return 0 if it passed, else 1.

    Raises:
        DeployError: the orders are invalid, the program could not be graded, or a file cannot be written.
    """
    check(exam, files)
    if exam.setup.ros2 and ISOLATED not in os.environ and why_not() is None:
        isolate()
    origin = provenance_of_this_command().model_dump()
    found = grade(exam, say)
    _write(files.html, lambda: report.page(found))
    _write(files.junit, lambda: report.junit(found))
    _write(files.json, lambda: json.dumps({"run": origin, **report.as_json(found)}) + "\n")
    show(None, report.table(found), as_json=False)
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
