"""`lifeline record`: record all messages in one MCAP file until Ctrl-C."""

import asyncio
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NoReturn

from deploy.stack.console import StatusLine, note, print_json
from deploy.stack.errors import DeployError
from deploy.stack.launch import Launch
from deploy.stack.reach import HeardSources, reach, run_command
from recordings.recording import Recorded, RecordingReader, RecordingWriter, exists
from supervisor.config import SupervisorSection
from wire import topics
from wire.bus import Bus, BusError, RawArrival, Subscription, wait_until
from wire.host.process import EXIT_FAILURE
from wire.stamp import Stamp, parse_stamp
from wire.topics import Topic

DEPTH = 4096
"""Queue depth of each topic; nothing is lost if the disk hangs for 40 s."""
LOOK_PERIOD_S = 0.1
FLUSH_PERIOD_S = 1.0
"""Maximum loss if the recorder is killed."""


@dataclass
class Channel:
    """A recorded topic."""

    name: str
    """The ROS name, with a leading slash."""
    msgtype: str
    subscription: Subscription[Any]
    messages: int = 0
    missed: int = 0
    """Samples that never arrived, counted by gaps in the sequence numbers."""
    last: Stamp | None = None

    @property
    def lost(self) -> int:
        """Number of sent samples that are not in the file; lost samples without a stamp are not counted."""
        return max(self.missed, self.subscription.overflowed)

    def take(self) -> Iterator[tuple[RawArrival, int]]:
        """Yield the samples since the last call, with their sequence numbers (0 without a stamp)."""
        for arrival in self.subscription.take_raw():
            stamp = parse_stamp(arrival.attachment)
            if stamp is not None:
                last, self.last = self.last, stamp
                if last is not None and last.gid == stamp.gid:
                    self.missed += max(0, stamp.sequence - last.sequence - 1)
            self.messages += 1
            yield arrival, 0 if stamp is None else stamp.sequence


@dataclass
class Report:
    """The result of a recording."""

    channels: list[Channel] = field(default_factory=list[Channel])
    duration_s: float = 0.0
    size_bytes: int = 0
    failure: str = ""
    """Why the recording ended early; empty if it did not."""

    @property
    def messages(self) -> int:
        return sum(channel.messages for channel in self.channels)


class Recorder:
    """Writes every message on a bus to a file.

    Args:
        bus: an open bus; the caller closes it.
        namespace: the first part of every topic's name.
        config: names the sources, the lidars and the e-stop stations; other sources are recorded once they are heard.
        writer: of the file.
        show: is called each second with the progress.
    """

    def __init__(
        self,
        bus: Bus,
        namespace: str,
        config: SupervisorSection,
        writer: RecordingWriter,
        show: Callable[[str], None],
    ) -> None:
        self._bus, self._namespace, self._writer, self._show = bus, namespace, writer, show
        self._loop = asyncio.get_running_loop()
        # One offset for all messages: a step of the wall clock does not reorder the recording.
        self._wall_ns = time.time_ns() - round(self._loop.time() * 1e9)
        self._report = Report()
        self._strangers = HeardSources(bus.hear_sources(), [source.name for source in config.sources])
        for topic in config.all_topics():
            self._add(topic)

    async def run(self, stop: asyncio.Event) -> Report:
        """Record until `stop`, or until a write fails."""
        report, began_s = self._report, self._loop.time()
        flush_s = began_s + FLUSH_PERIOD_S
        try:
            while True:
                last = stop.is_set()  # record what arrived before the stop
                self._take()
                report.duration_s = self._loop.time() - began_s
                if last:
                    break
                if self._loop.time() >= flush_s:
                    flush_s += FLUSH_PERIOD_S
                    self._writer.flush()
                    report.size_bytes = self._writer.size_bytes
                    self._show(f"recording: {_summary(report)}")
                await wait_until(stop, self._loop.time() + LOOK_PERIOD_S)
        except OSError as error:
            report.failure = str(error.strerror or error)
        try:
            self._writer.close()
        except OSError as error:
            report.failure = report.failure or str(error.strerror or error)
        report.size_bytes = self._writer.path.stat().st_size
        return report

    def _take(self) -> None:
        for source in self._strangers.take_new():
            self._add(topics.source_cmd_vel(source))
        for channel in self._report.channels:
            for arrival, sequence in channel.take():
                log_time_ns = self._wall_ns + round(arrival.arrival_s * 1e9)
                self._writer.write(
                    Recorded(channel.name, channel.msgtype, log_time_ns, sequence, arrival.payload)
                )

    def _add(self, topic: Topic[Any]) -> None:
        name = f"/{self._namespace}/{topic.key}"
        subscription = self._bus.subscribe(topic, depth=DEPTH)
        self._report.channels.append(Channel(name, topic.type.__msgtype__, subscription))


def record(path: Path, launch: Launch, *, as_json: bool = False) -> NoReturn:
    """Record until Ctrl-C, and exit: 0 if the file is complete.

    Raises:
        DeployError: the file exists, or the configuration is refused.
    """
    if path.exists():
        raise exists(path)
    config = launch.section("supervisor", SupervisorSection)
    run_command(lambda stop: _record(stop, path, launch, config, as_json=as_json))


def heard(launch: Launch, seconds: float) -> list[Recorded]:
    """Record a running robot for some seconds, and return the messages.

    Raises:
        NotRunningError: no supervisor answers.
        DeployError: the configuration or the endpoint is refused.
    """
    config = launch.section("supervisor", SupervisorSection)

    async def main(path: Path) -> None:
        stop = asyncio.Event()
        bus = await reach(launch.bus, stop)
        assert bus is not None  # nothing has set the event
        note(f"recording the robot at {launch.bus.endpoint} for {seconds:g} s")
        try:
            asyncio.get_running_loop().call_later(seconds, stop.set)
            writer = RecordingWriter(path)
            await Recorder(bus, launch.bus.namespace, config, writer, lambda _: None).run(stop)
        finally:
            await bus.close()

    with TemporaryDirectory() as directory:
        path = Path(directory) / "heard.mcap"
        try:
            asyncio.run(main(path))
        except BusError as error:
            raise DeployError(str(error)) from error
        return list(RecordingReader(path).messages())


async def _record(
    stop: asyncio.Event, path: Path, launch: Launch, config: SupervisorSection, *, as_json: bool
) -> int:
    bus = await reach(launch.bus, stop)
    if bus is None:
        return 0
    try:
        writer = RecordingWriter(path)
        screen = StatusLine(sys.stderr if as_json else None)
        screen.say(f"lifeline: recording to {path}; press Ctrl-C to end")
        report = await Recorder(bus, launch.bus.namespace, config, writer, screen.show).run(stop)
        screen.clear()
    finally:
        await bus.close()
    if as_json:
        print_json(_to_json(report, path))
    else:
        _print(report, path)
    if report.failure:
        note(
            f"cannot write the file any further ({report.failure}): it is readable up to its last flush; "
            "free disk space, and record to another file"
        )
    return EXIT_FAILURE if report.failure else 0


def _print(report: Report, path: Path) -> None:
    heard = [channel for channel in report.channels if channel.messages]
    width = max((len(channel.name) for channel in heard), default=0)
    for channel in heard:
        lost = f", {channel.lost:,} lost" if channel.lost else ""
        print(f"  {channel.name:<{width}}  {channel.messages:>9,}{lost}")
    lost = sum(channel.lost for channel in heard)
    print(
        f"lifeline: {path}: {_summary(report)}, {lost:,} lost" if heard else "lifeline: no messages received"
    )


def _to_json(report: Report, path: Path) -> dict[str, Any]:
    return {
        "file": str(path),
        "duration_s": round(report.duration_s, 3),
        "bytes": report.size_bytes,
        "topics": {
            channel.name: {"messages": channel.messages, "lost": channel.lost}
            for channel in report.channels
            if channel.messages
        },
        "failure": report.failure or None,
    }


def _summary(report: Report) -> str:
    return f"{report.duration_s:.1f} s, {report.messages:,} messages, {report.size_bytes / 1e6:.2f} MB"
