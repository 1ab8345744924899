"""Finds a black box by its name, and reads it as ROS messages, so that tools for recordings open it.

The names of the topics are those of the wire. The file holds what the law read, therefore:

* each message is stamped with its time of arrival; commands that could not be decoded are missing
* `cmd_vel` and `supervisor/status` have one message for each step of the law, without the states of the sources
* the pose in `odom` is the law's dead reckoning from odometry's velocity, with its origin at the first message
"""

import struct
from collections.abc import Generator, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from heapq import heappop, heappush
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from deploy.stack.errors import DeployError
from deploy.stack.launch import Launch
from deploy.stack.statedir import StateDir
from recordings.recording import Recorded
from supervisor.blackbox.file import OURS, SUFFIX
from supervisor.blackbox.reader import FARTHEST_S, BlackBoxError, BlackBoxReader, Step
from supervisor.config import SupervisorSection
from supervisor.law.model import Command, LawConfig, Odometry
from supervisor.law.reckoning import Odometer, reckon
from supervisor.law.scan import LaserScan
from supervisor.messages import HEADER_EPOCH, to_status, to_twist
from wire import messages as ros
from wire.freshness import Sent
from wire.host.config import ConfigError, absolute
from wire.text import printable
from wire.topics import CMD_VEL, ESTOP, ODOM, STATUS, Topic, lidar_scan, source_cmd_vel

REORDER_S = 1.0
"""Time within which messages are sorted; one that arrived earlier than this before its step may be out of order."""
MAX_WAITING = 20_000
"""Maximum number of messages that wait to be sorted; it bounds the memory if the file's times do not advance."""


class IncidentError(DeployError):
    """A black box cannot be read, or only a part of it; the message says why."""


@contextmanager
def damage_of(path: Path) -> Generator[None]:
    """Report every error of a computation over a black box as damage of the file.

    Values can fit their types and still not each other: the law never meets such values, and may raise any exception.

    Raises:
        IncidentError: the black box cannot be read, or the computation fails.
    """
    try:
        yield
    except DeployError:
        raise
    except BlackBoxError as error:
        raise IncidentError(str(error)) from error
    except Exception as error:
        raise IncidentError(f"{path} is damaged: {type(error).__name__}: {error}") from error


class _Heard(NamedTuple):
    """A message, with its time by the supervisor's monotonic clock."""

    time_s: float
    order: int
    topic: Topic[Any]
    message: ros.Message
    sequence: int


def messages(path: Path, namespace: str = "robot") -> Iterator[Recorded]:
    """Yield the messages of a black box in order of time.

    Args:
        path: the file.
        namespace: the first part of every topic's name; a black box does not contain it.

    Raises:
        IncidentError: the file cannot be read, or ends early; everything before was yielded.
    """
    with damage_of(path):
        reader = BlackBoxReader(path)
        last_ns = 0
        converter = _Converter(reader)
        for heard in _in_order(reader.steps(), converter):
            last_ns = max(last_ns, converter.utc_ns(heard.time_s))
            yield Recorded(
                f"/{namespace}/{heard.topic.key}",
                heard.topic.type.__msgtype__,
                last_ns,
                heard.sequence,
                _encoded(heard.message),
            )


def _in_order(steps: Iterable[Step], converter: "_Converter") -> Iterator[_Heard]:
    """Yield the messages of all steps in order of time; those of the last second wait for earlier ones."""
    waiting: list[_Heard] = []
    try:
        for step in steps:
            for heard in converter.messages(step):
                heappush(waiting, heard)
            while waiting and (waiting[0].time_s < step.now_s - REORDER_S or len(waiting) > MAX_WAITING):
                yield heappop(waiting)
    except BlackBoxError:
        yield from sorted(waiting)
        raise
    yield from sorted(waiting)


class _Converter:
    """Converts steps to messages, in order; the pose of the odometry is integrated over all steps."""

    def __init__(self, reader: BlackBoxReader) -> None:
        self._law: LawConfig = reader.law
        self._first = reader.stops[0]
        self._scans = [_topic_of(name) for name in reader.lidar_topics[: len(self._law.lidars)]]
        self._sources = {source.name: source_cmd_vel(source.name) for source in self._law.sources}
        self._odometer = Odometer()
        self._order = 0

    def messages(self, step: Step) -> Iterator[_Heard]:
        """Yield the messages that arrived before a step, then those that it published."""
        inputs = step.inputs
        for command in inputs.commands:
            yield from self._command(command)
        for scan in inputs.scans:
            yield from self._scan(scan)
        if inputs.odometry is not None:
            yield self._odom(inputs.odometry)
        if inputs.estop:
            yield self._heard(step.now_s, ESTOP, ros.Bool(data=True))
        yield self._heard(step.now_s, CMD_VEL, to_twist(step.decision.output))
        status = replace(
            to_status(step.decision, step.now_s), header=ros.header("base_link", self.utc_ns(step.now_s))
        )
        yield self._heard(step.now_s, STATUS, status)

    def _command(self, command: Command) -> Iterator[_Heard]:
        if command.velocity is not None and command.source in self._sources:
            twist = to_twist(command.velocity)
            yield self._heard(command.arrival_s, self._sources[command.source], twist, command.sent)

    def _scan(self, scan: LaserScan) -> Iterator[_Heard]:
        if not 0 <= scan.lidar < len(self._scans):
            return
        beams = len(scan.ranges)
        last_rad = scan.angle_min + max(0, beams - 1) * scan.angle_increment
        message = ros.LaserScan(
            ros.header(self._law.lidars[scan.lidar].name, self.utc_ns(scan.arrival_s)),
            angle_min=scan.angle_min,
            angle_max=last_rad if scan.angle_max is None else scan.angle_max,
            angle_increment=scan.angle_increment,
            time_increment=0.0,
            scan_time=0.0,
            range_min=scan.range_min,
            range_max=scan.range_max,
            ranges=np.asarray(scan.ranges, dtype=np.float32),
            intensities=np.empty(0, dtype=np.float32),
        )
        yield self._heard(scan.arrival_s, self._scans[scan.lidar], message, scan.sent)

    def _odom(self, sample: Odometry) -> _Heard:
        self._odometer = reckon(self._odometer, sample.velocity, sample.arrival_s, self._law.believable)
        message = ros.odometry(self._odometer.pose, sample.velocity, time_ns=self.utc_ns(sample.arrival_s))
        return self._heard(sample.arrival_s, ODOM, message)

    def _heard(
        self, time_s: float, topic: Topic[Any], message: ros.Message, sent: Sent | None = None
    ) -> _Heard:
        self._order += 1
        sequence = 0 if sent is None or sent.epoch == HEADER_EPOCH else sent.sequence
        return _Heard(time_s, self._order, topic, message, sequence)

    def utc_ns(self, time_s: float) -> int:
        """Return the wall time of a time of the supervisor's clock; one offset for all keeps their order."""
        after_s = time_s - self._first.now_s
        if not abs(after_s) <= FARTHEST_S:
            raise BlackBoxError(f"the black box is damaged: a message is {after_s:g} s from the stop")
        return self._first.utc_ns + round(after_s * 1e9)


def _encoded(message: ros.Message) -> bytes:
    try:
        return ros.encode(message)
    except (OverflowError, ValueError, struct.error) as error:
        raise BlackBoxError(f"the black box is damaged: {message.__msgtype__}: {error}") from error


def _topic_of(name: str) -> Topic[ros.LaserScan]:
    try:
        return lidar_scan(name)
    except ValueError as error:
        raise BlackBoxError(f"the lidar's topic {name!r:.80} {error}") from error


LAST = "last"


def directory_of(launch: Launch, state: StateDir) -> Path:
    """Return the directory of the black boxes.

    Raises:
        DeployError: the configuration is refused.
    """
    configured = launch.section("supervisor", SupervisorSection).black_box_dir
    try:
        return state.path / "blackbox" if configured is None else absolute(Path(configured))
    except ConfigError as error:
        raise DeployError(str(error)) from error


def black_boxes(directory: Path) -> list[Path]:
    """Return the black boxes in a directory in order of time; none if there is no directory.

    Raises:
        DeployError: the directory cannot be read.
    """
    try:
        return sorted(path for path in directory.iterdir() if OURS.fullmatch(path.name))
    except FileNotFoundError:
        return []
    except OSError as error:
        raise DeployError(
            f"cannot read {directory} ({error.strerror}): name another with --state-dir"
        ) from error


def find(directory: Path, name: str) -> Path:
    """Return the black box with a name, a unique beginning of a name, the path of a file, or the last one.

    Args:
        directory: of the black boxes.
        name: as the operator wrote it; the path of a file may be of any type.

    Raises:
        DeployError: there is none, or there are several.
    """
    if "/" in name or Path(name).is_file():
        return Path(name)
    paths = black_boxes(directory)
    if name == LAST and paths:
        return paths[-1]
    wanted = name.removesuffix(SUFFIX)
    found = [path for path in paths if id_of(path) == wanted] or [
        path for path in paths if path.name.startswith(wanted)
    ]
    if len(found) == 1:
        return found[0]
    if not found:
        some = f"{len(paths)} incidents, none of which is {printable(name)!r}" if paths else "no incidents"
        raise DeployError(f"{directory} has {some}: see `lifeline incidents list`")
    raise DeployError(
        f"{len(found)} incidents begin with {printable(name)!r}, such as {id_of(found[0])} and {id_of(found[-1])}: "
        "give more characters"
    )


def id_of(path: Path) -> str:
    return path.name.removesuffix(SUFFIX)
