"""Starts the nodes of a robot, and waits until they are alive; the caller holds the state directory's lock."""

import json
import re
import signal
import time
from contextlib import suppress

from deploy.stack import processes, supervisord
from deploy.stack.errors import DeployError, held_back
from deploy.stack.launch import Launch, check_endpoint_is_free
from deploy.stack.reach import observing
from deploy.stack.robot_file import read_robot
from deploy.stack.statedir import StateDir, UnwritableError
from deploy.stack.takedown import Say, listed
from wire import topics
from wire.host.config import ConfigError, read_toml

ALIVE_LIMIT_S = 20.0
STATION = "station"
"""The program of `Launch.station`."""
STATION_ADDRESS = re.compile(r"open (https?://\S+#\w+) within")
NEW_CODE = signal.SIGURG
"""Asks a station for a new code; a process that does not handle it ignores it."""
ASK_PERIOD_S = 0.2
ANSWER_LIMIT_S = 2.0


def check_nothing_runs(state: StateDir) -> None:
    """Refuse a second start.

    Raises:
        DeployError: a process of this state directory runs.
    """
    running = processes.of(state.path)
    if not running:
        return
    if any(p.name == "supervisord" for p in running):
        launch = Launch.running(state)
        drive = "" if launch is None else f"drive it with `{launch.drive}`, "
        raise DeployError(
            f"a robot already runs in {state.path}: {drive}check it with `lifeline status{state.option}`, "
            f"stop it with `lifeline down{state.option}`"
        )
    raise DeployError(
        f"an earlier supervisord was killed and left {listed(running)} running: clean up with "
        f"`lifeline down{state.option}`"
    )


def start(state: StateDir, launch: Launch, say: Say) -> None:
    """Start supervisord with its programs, without waiting until they are alive.

    Raises:
        DeployError: the start is impossible or failed; no process is left running.
    """
    check_nothing_runs(state)
    state.forget()
    if topics.SUPERVISOR in launch.nodes:
        check_endpoint_is_free(launch.bus.endpoint)
    check_configuration(launch)
    uv = supervisord.find_uv()
    for node in (*launch.nodes, STATION):
        state.log(node).unlink(missing_ok=True)
    try:
        state.record.write_text(json.dumps(launch.to_record()))
    except OSError as error:
        raise UnwritableError(state, error) from error
    supervisord.start(uv, state, launch, say)


def check_configuration(launch: Launch) -> None:
    """Refuse a configuration that would fail or be unsafe at runtime. Without a sim, it needs neither MuJoCo nor a scene.

    Raises:
        DeployError: a section or the scene is invalid, the simulated robot extends beyond the footprint, or the
            interpreter of the ROS 2 process is missing.
    """
    try:
        sections = read_robot(read_toml(launch.config), simulated=topics.SIM in launch.nodes)
    except ConfigError as error:
        raise DeployError(str(error)) from error
    if topics.SIM in launch.nodes:
        with held_back():
            from deploy.stack.preflight import check_scene  # noqa: PLC0415 - needs the extra `sim`

        check_scene(launch, sections)
    if topics.ROS2 in launch.nodes:
        from deploy.stack.ros2_program import interpreter  # noqa: PLC0415 - not without [ros2]

        interpreter(launch.config)


async def check_supervisor_answers(launch: Launch) -> None:
    """Refuse to start a base alone where no supervisor answers.

    Raises:
        DeployError: none does.
    """
    if topics.SUPERVISOR in launch.nodes:
        return
    try:
        async with observing(launch.bus, ANSWER_LIMIT_S):
            return
    except TimeoutError as error:
        raise DeployError(
            f"no supervisor answers at {launch.bus.endpoint}, and {' and '.join(launch.nodes)} cannot run without one: "
            "start it first, or add --only supervisor"
        ) from error


async def wait_until_alive(state: StateDir, launch: Launch, say: Say) -> None:
    """Wait for the token of every node, and report which are missing.

    Raises:
        DeployError: a node does not start; the message includes the end of its log.
    """
    deadline_s = time.monotonic() + ALIVE_LIMIT_S
    health = Health(state)
    said: set[str] = set()
    wanted = set(launch.nodes)

    def waiting_for(missing: set[str]) -> None:
        nonlocal said
        if missing and missing != said:
            say(f"waiting for {' and '.join(sorted(missing))}")
        said = missing

    waiting_for(wanted)
    while True:
        try:
            async with observing(launch.bus, ASK_PERIOD_S) as observer:
                while time.monotonic() < deadline_s:
                    if await observer.until(lambda robot: robot.alive >= wanted, ASK_PERIOD_S):
                        return
                    waiting_for(wanted - observer.alive)
                    health.check()
        except TimeoutError:
            health.check()
        if time.monotonic() >= deadline_s:
            raise DeployError(
                f"{' and '.join(sorted(said))} did not start within {ALIVE_LIMIT_S:g} s{_with_logs(state, said)}"
            )


def new_station_address(state: StateDir) -> str:
    """Ask the page of an e-stop station that runs beside the nodes for a new code, and return its address.

    Raises:
        DeployError: it does not run or does not answer.
    """
    # Where nothing runs, nothing will start it.
    deadline_s = time.monotonic() + (ALIVE_LIMIT_S if processes.of(state.path) else 0.0)
    health = Health(state)
    before: int | None = None
    while time.monotonic() < deadline_s:
        with suppress(OSError):
            addresses = STATION_ADDRESS.findall(state.end_of_log(STATION))
            if before is not None and len(addresses) > before:
                return addresses[-1]
            if before is None and addresses:  # it has begun to listen for the signal
                before = len(addresses)
                for process in processes.of(state.path):
                    if process.name == STATION:
                        processes.send(process, state.path, NEW_CODE)
        health.check()
        time.sleep(processes.POLL_S)
    raise DeployError(
        f"no e-stop station runs in {state.path}: start it with `lifeline up --station`{_with_logs(state, {STATION})}"
    )


class Health:
    """Detects a program that exits repeatedly, so that the start fails without waiting for the limit."""

    def __init__(self, state: StateDir) -> None:
        self._state = state
        self._pids: dict[str, set[int]] = {}
        self._failed_starts: dict[str, set[int]] = {}

    def check(self) -> None:
        for program in supervisord.programs(self._state) or ():
            # The state alone is not enough: on a busy machine, a program that fails can run for longer than startsecs,
            # and supervisord then restarts it at once.
            pids = self._pids.setdefault(program.name, set())
            failed = self._failed_starts.setdefault(program.name, set())
            if program.pid:
                pids.add(program.pid)
            else:
                failed.add(program.start)
            deaths = max(len(pids) - bool(program.pid), len(failed))
            if program.state == "FATAL" or deaths > 1:
                raise DeployError(
                    f"{program.name} exits soon after each start{_with_logs(self._state, {program.name})}"
                )


def _with_logs(state: StateDir, programs: set[str]) -> str:
    logs = [(state.log(p), state.last_lines(p)) for p in sorted(programs)]
    return "".join(
        f"; the end of {path}:\n{lines}" if lines else f"; {path} is empty" for path, lines in logs
    )
