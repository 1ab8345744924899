"""`lifeline up`: start the stack, and run teleop in this terminal or let a page drive."""

import asyncio
import json
import os
import signal
import subprocess
import sys
import termios
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from typing import Any, NoReturn

from deploy.stack import bringup, errors, processes, takedown
from deploy.stack.errors import DeployError
from deploy.stack.launch import SIMULATED, Launch
from deploy.stack.statedir import StateDir, locked
from deploy.stack.takedown import Say
from teleop.terminal import RESTORE
from teleop.terminal_guard import BY_PARENT
from wire import tls, topics
from wire.bundle import BundleError, choose_bundle
from wire.bus_config import BusConfig
from wire.host.command_line import PROGRAM
from wire.roles import Role
from wire.zenoh.local_socket import participants

TELEOP_LIMIT_S = 4.0
"""Longer than teleop's own shutdown limit of 3 s."""


def up(
    state: StateDir,
    launch: Launch,
    say: Say,
    *,
    detach: bool,
    as_json: bool = False,
    show_station: Callable[[str], None] = print,
) -> int:
    """Start the stack, run teleop unless a page drives, and return teleop's exit code (128 + N if signal N ended it).

    Args:
        state: where its records and logs are.
        launch: what is started.
        say: reports progress.
        detach: whether to return instead of running teleop.
        as_json: whether to print how to reach the robot as JSON.
        show_station: shows the address of the station's page.

    Raises:
        DeployError: the stack could not start; every process started here has been stopped.
    """
    if as_json and not detach:
        raise DeployError("--json needs --detach: without it, teleop uses this terminal")
    if not detach and not (sys.stdin.isatty() and sys.stdout.isatty()):
        if launch.drives_on_page:
            raise DeployError("a new code for the page needs a terminal: add --detach")
        raise DeployError(
            "teleop needs a terminal, but input or output is not one: use --detach to start the robot without teleop, "
            "or `lifeline demo`, which needs no keys"
        )
    state.create()
    bringup.check_nothing_runs(state)  # before the lock, which `up` with teleop keeps
    keep = False
    with errors.interrupts(), locked(state, "up"):
        bringup.check_nothing_runs(state)
        try:
            try:
                if launch.nodes != SIMULATED:
                    say(_starting(launch))
                asyncio.run(bringup.check_supervisor_answers(launch))
                bringup.start(state, launch, say)
                asyncio.run(bringup.wait_until_alive(state, launch, say))
                _announce(state, launch, say, detach=detach, as_json=as_json, show_station=show_station)
                if detach:
                    keep = True
                    return 0
                if launch.drives_on_page:
                    _offer_codes(state, say, show_station)
                    return 0
                return _teleop_here(state, launch, say)
            finally:
                errors.ignore()
        finally:
            if not keep:
                stopped = takedown.stop(state)
                with suppress(OSError):  # the terminal may be closed
                    if stopped.names:
                        say("everything is stopped")


def _announce(
    state: StateDir,
    launch: Launch,
    say: Say,
    *,
    detach: bool,
    as_json: bool,
    show_station: Callable[[str], None],
) -> None:
    """Print what a person or a program must know about the robot that runs now."""
    latched = launch.latched_sentence(state)
    if latched is not None:
        say(latched)
    station = bringup.new_station_address(state) if launch.station else None
    if as_json:
        print(json.dumps(_document(state, launch, is_latched=latched is not None, station=station), indent=2))
        return
    for hint in hints(state, launch) if detach else ():
        say(hint)
    if station is not None:
        show_station(station)
        if not detach and not launch.drives_on_page:
            say(
                "Enter: start teleop, which uses this terminal; to drive on the page instead, start with --drive"
            )
            sys.stdin.readline()


def _offer_codes(state: StateDir, say: Say, show_station: Callable[[str], None]) -> None:
    """Show the page's address with a new code at each Enter, until the end of input."""
    say("Enter: a new code; Ctrl-C: stop everything")
    while sys.stdin.readline():
        show_station(bringup.new_station_address(state))


def become_teleop(launch: Launch, options: Sequence[str]) -> NoReturn:
    """Replace this process by teleop for a robot, with more options."""
    environment = os.environ | {PROGRAM: f"lifeline {topics.TELEOP}"}
    os.execve(sys.executable, [*launch.command(topics.TELEOP), *options], environment)  # noqa: S606 - no shell is needed


def hints(state: StateDir, launch: Launch) -> Iterator[str]:
    """Yield what to do with a robot that runs in the background."""
    yield (
        f"running at {launch.bus.endpoint}; check it with `lifeline status{state.option}`, "
        f"stop it with `lifeline down{state.option}`"
    )
    if launch.drives_on_page:
        yield "drive on the page; `lifeline station --new-code` prints a new code"
    elif _can_drive(launch.bus):
        yield f"drive with `{launch.drive}`"
    else:
        yield (
            f"no bundle in {launch.bus.keys} may drive: the operator needs one of `lifeline keys issue NAME --role operator "
            f"--robot {launch.bus.namespace}`"
        )
    if (there := participants(launch.bus.endpoint)) is not None:
        yield f"your own Zenoh programs connect to {there}"


def _can_drive(bus: BusConfig) -> bool:
    """Return whether teleop has a bundle of its role here, or needs none."""
    if bus.keys is None or not tls.is_secure(bus.endpoint):
        return True
    try:
        return choose_bundle(bus.keys, time.time(), part=Role.OPERATOR).role is Role.OPERATOR
    except BundleError:
        return False


def _starting(launch: Launch) -> str:
    """Return what is started, for a robot that is not simulated."""
    started = " and ".join(launch.nodes)
    if topics.SUPERVISOR not in launch.nodes:
        return f"starting {started} for the supervisor at {launch.bus.endpoint}"
    if topics.ROS2 in launch.nodes:
        return f"starting {started}, because the configuration has [ros2]"
    return f"starting {started} without a sim: the base must connect to {launch.bus.endpoint}"


def _document(state: StateDir, launch: Launch, *, is_latched: bool, station: str | None) -> dict[str, Any]:
    return {
        "endpoint": launch.bus.endpoint,
        "participants": participants(launch.bus.endpoint),
        "namespace": launch.bus.namespace,
        "state_dir": str(state.path),
        "nodes": launch.nodes,
        "estop_latched": is_latched,
        "station": station,
        "teleop": launch.command(topics.TELEOP),
    }


def _teleop_here(state: StateDir, launch: Launch, say: Say) -> int:
    """Run teleop in the foreground, then restore the terminal's settings."""
    terminal = sys.stdin.fileno()
    before = termios.tcgetattr(terminal)
    mark = {processes.MARK: str(state.path), BY_PARENT: "1"}
    child = subprocess.Popen(launch.command(topics.TELEOP), env=os.environ | mark)
    try:
        code = child.wait()
        if code < 0:
            print(
                RESTORE if os.environ.get("TERM", "dumb") != "dumb" else ""
            )  # teleop could not restore the screen itself
            say(f"teleop was ended by {signal.Signals(-code).name}")
        return code if code >= 0 else 128 - code
    finally:
        try:
            child.terminate()
            child.wait(TELEOP_LIMIT_S)
        except subprocess.TimeoutExpired:
            child.kill()
            child.wait()
        # If the shell already controls the terminal, tcsetattr would stop this process with SIGTTOU.
        signal.signal(signal.SIGTTOU, signal.SIG_IGN)
        with suppress(termios.error):
            termios.tcsetattr(terminal, termios.TCSADRAIN, before)
