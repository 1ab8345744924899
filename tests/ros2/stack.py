"""The supervisor and the ROS 2 process between a robot and its command sources, all as real processes."""

import asyncio
import signal
import sys
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Protocol

from tests.ros2.host import PATIENCE_S, ROS_PYTHON, Host, Line, Peer
from tests.system.ports import free_endpoint
from wire import topics
from wire.messages import DiagnosticArray, DiagnosticStatus, SafetyStatus, SourceStatus
from wire.zenoh.bus import BusConfig, open_bus

SPEED_M_S = 0.3
ATTEMPTS, SPEED_LIMIT_S = 5, 3.0
SOURCE, TOPIC = "joy", "/joy_vel"
ESTOP_SUBSCRIPTIONS, LATCHED_ESTOP_SUBSCRIPTIONS = 2, 3
"""Those of the process `ros2` that match a volatile and a transient local button."""

SUPERVISOR = """
[bus]
endpoint = "{endpoint}"
[supervisor]
mounts_confirmed = true
black_box_dir = "{folder}/blackbox"
"""
CONFIGURATION = (
    SUPERVISOR
    + """\
sources = [{{ name = "teleop", priority = 100 }}, {{ name = "joy", priority = 90 }}, {{ name = "keys", priority = 80 }}, {{ name = "plan", priority = 10 }}]
[ros2]
domain_id = {domain}
{ros2}
sources = [
  {{ name = "joy", topic = "/joy_vel"{source} }},
  {{ name = "keys", topic = "/keys_vel", hold_s = 0.6 }},
  {{ name = "plan", topic = "/plan_vel", arm = "on_request" }},
]
"""
)


class Watch:
    """Follows the supervisor's status and the reports of the ROS 2 process, on a thread of its own."""

    def __init__(self, endpoint: str) -> None:
        self._changed = threading.Condition()
        self.status: SafetyStatus | None = None
        self.statuses = 0
        """Number of statuses so far."""
        self.reports: dict[str, DiagnosticStatus] = {}
        self._end: Callable[[], object] = lambda: None
        self._thread = threading.Thread(target=lambda: asyncio.run(self._run(endpoint)), daemon=True)
        self._thread.start()

    async def _run(self, endpoint: str) -> None:
        ended, wake = False, asyncio.Event()
        loop = asyncio.get_running_loop()

        def end() -> None:
            nonlocal ended
            ended = True
            wake.set()

        self._end = lambda: loop.call_soon_threadsafe(end)
        bus = await open_bus(BusConfig(endpoint), "client")
        statuses = bus.subscribe(topics.STATUS, wake=wake)
        reports = bus.subscribe(topics.DIAGNOSTICS, wake=wake, depth=8)
        try:
            while not ended:
                await wake.wait()
                wake.clear()
                status = statuses.latest()
                arrays = [a.message for a in reports.take() if a.message is not None]
                with self._changed:
                    if status is not None:
                        self.status = status.message
                        self.statuses += 1
                    for array in arrays:
                        self._add(array)
                    self._changed.notify_all()
        finally:
            await bus.close()

    def _add(self, array: DiagnosticArray) -> None:
        self.reports.update({status.name.removeprefix("lifeline: "): status for status in array.status})

    def until(self, condition: Callable[["Watch"], bool], what: str, within_s: float = PATIENCE_S) -> None:
        with self._changed:
            if not self._changed.wait_for(lambda: condition(self), within_s):
                raise AssertionError(f"not seen within {within_s:g} s: {what}; {self.status}; {self.reports}")

    def report(self, name: str, part: str) -> DiagnosticStatus:
        """Wait until a report contains a text, and return it."""
        self.until(lambda w: name in w.reports and part in w.reports[name].message, f"{part!r} in {name}")
        return self.reports[name]

    def close(self) -> None:
        self._end()
        self._thread.join(5.0)


class Stack:
    """The supervisor, the ROS 2 process, an observer and a watch; the caller starts the robot.

    Args:
        host: starts the processes.
        folder: for the configuration and the state.
        ros2: further lines of `[ros2]`.
        observer: options of the observer.
        source: a further key of the source `joy`.
    """

    def __init__(
        self, host: Host, folder: Path, ros2: str = "", observer: Sequence[str] = (), source: str = ""
    ) -> None:
        self.host = host
        self.endpoint = free_endpoint()
        self.config = folder / "robot.toml"
        self.config.write_text(
            CONFIGURATION.format(
                endpoint=self.endpoint,
                folder=folder,
                domain=host.domain,
                ros2=ros2,
                source=f", {source}" if source else "",
            )
        )
        self._variables = {"LIFELINE_STATE_DIR": str(folder / "state")}
        (folder / "state").mkdir()
        self._sources: list[Peer] = []
        self.observer = host.start("observer", *observer).ready()
        self.supervisor = self.start_supervisor()
        self.bridge = self.start_bridge()
        self.watch = Watch(self.endpoint)
        self.observer.until(lambda line: line.get("topic") == "cmd_vel", "discovery of the process ros2")

    def start_supervisor(self) -> Peer:
        command = [sys.executable, "-m", "supervisor", "--config", str(self.config)]
        self.supervisor = self.host.run("supervisor", command, {**self.host.variables, **self._variables})
        return self.supervisor

    def start_bridge(self) -> Peer:
        command = [str(ROS_PYTHON), "-m", "ros2", "--config", str(self.config)]
        self.bridge = self.host.run("ros2", command, self.host.rclpy_variables)
        return self.bridge

    def tidy(self) -> None:
        """End all sources, and continue what a test has stopped."""
        for peer in self._sources:
            peer.end()
        self._sources.clear()
        for peer in (self.supervisor, self.bridge):
            peer.process.send_signal(signal.SIGCONT)

    def source(self, *options: str, name: str = "source", topic: str = TOPIC) -> Peer:
        peer = self.host.start("source", "--name", name, "--topic", topic, *options)
        self._sources.append(peer)
        return peer.ready()

    def armed(self, source: str = SOURCE) -> None:
        """Wait until a source is armed and neutral, by a status that was sent from now on."""
        self._fresh(source, lambda seen: seen.armed and seen.neutral, "armed")

    def neutral(self, source: str = SOURCE) -> None:
        """Wait until a source is heard and neutral, by a status that was sent from now on."""
        self._fresh(source, lambda seen: seen.neutral, "neutral")

    def _fresh(self, source: str, holds: Callable[[SourceStatus], bool], what: str) -> None:
        before = self.watch.statuses

        def is_so(watch: Watch) -> bool:
            status = watch.status
            return (
                watch.statuses > before + 1  # one may be on its way
                and status is not None
                and any(seen.name == source and holds(seen) for seen in status.sources)
            )

        self.watch.until(is_so, f"{source} {what}")

    def drive(self, source: Peer, speed_m_s: float = SPEED_M_S, name: str = SOURCE) -> None:
        """Make a source command zero and then a speed, until the robot moves at this speed."""

        def is_at_speed(line: Line) -> bool:
            return line.get("topic") == "odom" and abs(line["v"] - speed_m_s) < 0.02

        self.obeys(source, is_at_speed, f"{speed_m_s} m/s", name, v=speed_m_s)

    def obeys(
        self,
        source: Peer,
        condition: Callable[[Line], bool],
        what: str,
        name: str = SOURCE,
        **velocity: float,
    ) -> None:
        """Make a source command zero and then a velocity, until a new line of the observer meets the condition.

        A loaded machine may stop the robot in between (OVERRUN): the source then begins again.
        """
        for _ in range(ATTEMPTS):
            source.tell(v=0.0)
            self.armed(name)
            seen = len(self.observer.lines)
            source.tell(**velocity)
            with suppress(AssertionError):
                self.observer.until(condition, what, after=seen, within_s=SPEED_LIMIT_S)
                return
            print(f"\nnot seen: {what}; again: {self.watch.status and self.watch.status.reasons}")
        raise AssertionError(f"not seen after {ATTEMPTS} attempts: {what}; {self.watch.status}")

    def zero_after(self, from_ns: int, within_s: float = 2.0) -> float:
        """Return the time from `from_ns` to the first of ten consecutive zeros on cmd_vel [ms]."""
        zeros = 0
        first: Line = {}

        def ten_zeros(line: Line) -> bool:
            nonlocal zeros, first
            if line.get("topic") != "cmd_vel" or line["at_ns"] < from_ns:
                return False
            if line["v"] or line["w"]:
                zeros = 0
                return False
            first = line if zeros == 0 else first
            zeros += 1
            return zeros == 10

        self.observer.until(ten_zeros, "zero on cmd_vel", within_s=within_s)
        return (first["at_ns"] - from_ns) / 1e6

    def rest_after(self, from_ns: int, within_s: float = 5.0) -> float:
        """Return the time from `from_ns` to standstill [ms]."""
        rest = self.observer.until(
            lambda line: line.get("topic") == "odom" and line["at_ns"] > from_ns and abs(line["v"]) < 0.005,
            "standstill",
            within_s=within_s,
        )
        return (rest["at_ns"] - from_ns) / 1e6

    def stays_at_rest(self, messages: int = 50) -> None:
        """Check that the next messages on cmd_vel are all zero."""
        from_ns, count = time.monotonic_ns(), 0

        def enough(line: Line) -> bool:
            nonlocal count
            count += line.get("topic") == "cmd_vel" and line["at_ns"] > from_ns
            return count >= messages

        self.observer.until(enough, f"{messages} messages on cmd_vel")
        moving = [line for line in self.observer.of("cmd_vel", from_ns=from_ns) if line["v"] or line["w"]]
        assert not moving, moving[:3]

    def close(self) -> None:
        self.watch.close()


class MakeStack(Protocol):
    """Returns a stack, with the further lines of `[ros2]`, the options of the observer, and a further key of the source."""

    def __call__(self, ros2: str = "", *observer: str, source: str = "") -> Stack: ...


def reset(caller: Peer) -> Line:
    """Call the reset, and return its answer."""
    seen = len(caller.lines)
    caller.tell(service="/lifeline/reset")
    return caller.until(lambda line: "success" in line, "a reply", after=seen)


def send(peer: Peer, number: signal.Signals) -> int:
    """Send a signal, and return the time just before [ns]."""
    at_ns = time.monotonic_ns()
    peer.process.send_signal(number)
    return at_ns
