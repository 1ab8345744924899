"""Measures a passport of docs/passports: `python -m docs.generate.measure_passport`, or `make passport`.

A simulated robot, or the ROS 2 robot of the tests, drives in a hall. A program answers the questions of `lifeline passport measure` as a
person does; the system tests use it too. The page is signed by a new authority, of which only the certificate is kept. A measurement that
was interrupted is continued by the same command; without its record, docs/passports/ROBOT.json, it begins again. With `--record`, it only measures.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pexpect

from commission.commission import EXIT_INTERRUPTED
from deploy.keys.commands import init, issue
from deploy.keys.register import Request
from deploy.stack.errors import DeployError
from deploy.stack.launch import free_loopback_endpoint
from docs.generate.passports import DEMO, FOLDER, ROS2, certificate_of, page_of
from passport.cells import Fault
from passport.reading import report
from passport.record import Passport, from_json
from tests.ros2.host import DOMAINS, ROS_PYTHON, Host, ros_domain
from wire.bundle import AUTHORITY
from wire.roles import Role

PATIENCE_S = 60.0
MOST_REPEATS = 20
"""Of one run. A busy machine stops the robot; a person then repeats the run."""
BUNDLE_S = 86400.0
BRAKING_M_S2, SPEED_M_S = 1.5, 0.5
HALL = "[hall]\nsize_m = [12.6, 12.8]\n\n[start]\nx_m = 0.3\n"
"""The wall ahead is the nearest, 6 m away: without Lifeline, a robot that does not stop needs this room. The others are within the lidar's range of
12 m until the robot has driven 3.5 m: a wall beyond it would count as unseen space."""
START_X_M = 2.0
"""Of the ROS 2 robot: 3.5 m from the wall ahead (tests/ros2/peers/room.py)."""
DEMO_FILE = f"""\
[supervisor]
max_linear_m_s = {SPEED_M_S}

[sim]
scene = "hall.toml"
moving = false
max_linear_m_s = {SPEED_M_S}
braking_m_s2 = {BRAKING_M_S2}
"""
ROS2_TIMEOUT_S, ROS2_SPEED_M_S, ROS2_TURN_RAD_S = 0.5, 0.4, 1.5
ROS2_FILE = f"""\
[supervisor]
max_linear_m_s = {ROS2_SPEED_M_S}
max_angular_rad_s = {ROS2_TURN_RAD_S}
deceleration_m_s2 = 1.5
base_timeout_s = {ROS2_TIMEOUT_S}
mounts_confirmed = true
sources = [{{{{ name = "teleop", priority = 100 }}}}, {{{{ name = "path", priority = 10 }}}}]
[supervisor.lidar]
view_rad = [-3.14159, 3.14159]
beams = 360
range_max_m = 12.0
period_s = 0.05
[ros2]
domain_id = {{domain}}
"""
QUESTIONS = {
    r"Type yes if it agrees\.": "yes",
    r"Type what the floor is": "simulated",
    r"Type go to drive": "go",
    r"Type without to drive": "without",
    r"Type the mass": "0 kg",
    r"Type again to repeat": "again",
    r"Type reset to reset": "reset",
}
PREFIX = "lifeline: "
PROGRESS = rf"{PREFIX}[^\r\n]*, load \d+ %[^\r\n]*\r\n"
"""A run, an interruption, or a cell that is not measured."""
RUN = re.compile(r"run \d+ of \d+")


def lifeline(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "lifeline.cli.app", *arguments]


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a command to its end, without a terminal."""
    return subprocess.run(
        lifeline(*arguments),
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
        timeout=90,
    )


class Site:
    """A robot in front of a wall, in its own directory.

    Args:
        directory: short, because of the socket in it.
        endpoint: a free one.
        robot: the text of its file.
        name: of this file, which a passport shows.
    """

    def __init__(
        self, directory: Path, endpoint: str, robot: str = DEMO_FILE, name: str = "simulated.toml"
    ) -> None:
        self.file, self.out = directory / name, directory / "passport.json"
        self.state = directory / "state"
        self.endpoint = endpoint
        self._options = ("--endpoint", endpoint, "--state-dir", str(self.state))
        self.file.write_text(robot)
        (directory / "hall.toml").write_text(HALL)

    def up(self) -> None:
        """Start the robot.

        Raises:
            DeployError: it did not start.
        """
        started = run("up", "--detach", "--no-viewer", "--config", str(self.file), *self._options)
        if started.returncode != 0:
            raise DeployError(started.stderr.strip())

    def down(self) -> None:
        run("down", *self._options[2:])

    def measure(self, *faults: str, runs: int = 1, without: bool = False) -> "pexpect.spawn[str]":
        named = [word for fault in faults for word in ("--fault", fault)]
        command = lifeline(
            "passport", "measure", str(self.file), *self._options, *named,
            "--out", str(self.out), "--load", "0", "--runs", str(runs),
            *(["--without"] if without else []),
        )  # fmt: skip
        # Where no terminal is named, as under CI, no progress would be shown.
        named = os.environ | {"TERM": "xterm-256color"}
        return pexpect.spawn(command[0], command[1:], env=named, dimensions=(50, 200), encoding="utf-8")

    def record(self) -> Passport:
        return from_json(self.out.read_text())


@contextmanager
def site(endpoint: str, *robot: str) -> Generator[Site]:
    """Give a robot (as `Site` does) a directory while the context is open, then end it."""
    directory = Path(tempfile.mkdtemp(prefix="lifeline-"))  # pytest's paths are too long for a socket
    one = Site(directory, endpoint, *robot)
    try:
        yield one
    finally:
        one.down()
        shutil.rmtree(directory, ignore_errors=True)


def answer(
    terminal: "pexpect.spawn[str]",
    until: str | None = None,
    say: Callable[[str], object] = lambda _: None,
) -> None:
    """Answer all questions until a text is shown.

    Args:
        terminal: of `lifeline passport measure`.
        until: the text; None: until the end.
        say: receives each line about a run.

    Raises:
        DeployError: a run was interrupted again and again.
        pexpect.TIMEOUT: nothing was asked or shown for a minute.
    """
    questions = [f"{question}[^\r]*\r\n" for question in QUESTIONS]
    patterns: list[Any] = [*questions, PROGRESS, until or pexpect.EOF]
    repeats, line = 0, ""
    while (shown := terminal.expect(patterns, timeout=PATIENCE_S)) <= len(QUESTIONS):
        if shown == len(QUESTIONS):
            line = str(terminal.after).strip().removeprefix(PREFIX)
            say(line)
            repeats = 0 if RUN.search(line) else repeats
            continue
        word = list(QUESTIONS.values())[shown]
        repeats += word == "again"
        if repeats >= MOST_REPEATS:
            raise DeployError(f"a run was interrupted {repeats} times, at last: {line}")
        terminal.send(f"{word}\r")


@contextmanager
def demo_robot() -> Generator[Site]:
    """The simulated robot, which runs while the context is open."""
    with site(free_loopback_endpoint()) as one:
        one.up()
        yield one


@contextmanager
def ros2_robot() -> Generator[Site]:
    """The ROS 2 robot of the tests, which runs while the context is open."""
    if not ROS_PYTHON.exists():
        raise DeployError("there is no environment with rclpy: run `make ros2`")
    with tempfile.TemporaryDirectory() as logs, ros_domain(DOMAINS[0]) as domain:
        host = Host(domain, Path(logs))
        try:
            host.start("diff_drive", "--x", str(START_X_M), "--timeout", str(ROS2_TIMEOUT_S)).ready()
            file = ROS2_FILE.format(domain=domain)
            with site(free_loopback_endpoint(), file, "simulated-ros2.toml") as one:
                one.up()
                yield one
        finally:
            host.close()


ROBOTS = {DEMO: demo_robot, ROS2: ros2_robot}


def measure(robot: str, runs: int, faults: Sequence[str], only_record: Path | None) -> str:
    """Measure, write and sign the page of a robot, and return its result.

    Args:
        robot: of `ROBOTS`.
        runs: of each cell.
        faults: only these; empty: all.
        only_record: the file of the record, if only the measurement is wanted; None: also write the page.

    Raises:
        DeployError: it was not measured to the end.
    """
    record = FOLDER / f"{robot}.json" if only_record is None else only_record.resolve()
    with ROBOTS[robot]() as one:
        one.out = record
        for without in (False, True) if not faults else (False,):
            _conduct(one.measure(*faults, runs=runs, without=without))
    if only_record is not None:
        return f"{only_record}: measured"
    with tempfile.TemporaryDirectory() as folder:
        keys = Path(folder) / "keys"
        init(keys, replace=False)
        bundle = Path(issue(keys, Request(robot, Role.SUPERVISOR, "robot", None), BUNDLE_S)["bundle"])
        written = report(record, page_of(robot), bundle)
        shutil.copyfile(bundle / AUTHORITY, certificate_of(robot))
    record.unlink()
    return f"docs/passports/{page_of(robot).name}: {written.shows}"


def _conduct(terminal: "pexpect.spawn[str]") -> None:
    """Answer as a person until the measurement has ended.

    Raises:
        DeployError: it was not measured to the end.
    """
    try:
        answer(terminal, say=lambda line: print(line, flush=True))
    except pexpect.TIMEOUT as error:
        raise DeployError(f"nothing was asked or shown for a minute: {terminal.before}") from error
    finally:
        if terminal.isalive():  # its end stops the robot, and starts what it has stopped
            terminal.sendintr()
            with suppress(pexpect.TIMEOUT):
                terminal.expect(pexpect.EOF, timeout=PATIENCE_S)
        terminal.close(force=True)
    if terminal.exitstatus != os.EX_OK:
        raise DeployError((terminal.before or "").strip())


def main() -> int:
    """Measure; return 1 with one sentence on stderr if that is not possible, 130 if it was interrupted."""
    parser = argparse.ArgumentParser(prog="python -m docs.generate.measure_passport")
    parser.add_argument("--robot", choices=ROBOTS, default=DEMO)
    parser.add_argument("--runs", type=int, default=10, help="of each cell")
    parser.add_argument("--fault", action="append", choices=list(Fault), default=[], help="only this fault")
    parser.add_argument(
        "--record", metavar="FILE", type=Path, help="measure into this record, and write no page"
    )
    options = parser.parse_args()
    try:
        print(measure(options.robot, options.runs, options.fault, options.record))
    except DeployError as error:
        print(f"The passport was not measured: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("interrupted: the same command continues this measurement", file=sys.stderr)
        return EXIT_INTERRUPTED
    return 0


if __name__ == "__main__":
    sys.exit(main())
