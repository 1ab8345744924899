"""Reads a recording as a stream of messages: MCAP, rosbag2's SQLite, the folder of a rosbag2 recording, or a black box.

A message that arrives up to `REORDER_S` later in the file than its time is put in order. The memory is bounded by the
messages of this time.
"""

from abc import ABC, abstractmethod
from collections.abc import Collection, Generator, Iterable
from contextlib import contextmanager
from heapq import heappop, heappush
from pathlib import Path
from typing import NamedTuple

from mcap.records import Channel, Schema, Statistics
from rosbags.rosbag2 import Reader

from deploy.stack.errors import DeployError
from recordings.incidents.incident import IncidentError, damage_of, messages
from recordings.recording import MAX_TIME_NS, MESSAGE_ENCODING, Recorded, RecordingReader
from supervisor.blackbox.file import SUFFIX
from supervisor.blackbox.reader import BlackBoxReader
from wire.foreign import open_file, read_text
from wire.host.process_limits import bounded_growth

REORDER_S = 1.0
SET_BACK_S = 10.0
"""A message this much earlier than one before it in the file shows that the clock was set back: the times go on after a pause."""
PAUSE_S = 20.0
COMPRESSED = (".zstd", ".zst", ".lz4")
METADATA = "metadata.yaml"
MAX_METADATA = 256 << 10
"""Characters, for about 600 topics; 256 KiB of YAML can take 5 s."""
MAX_GROWTH_BYTES = 512 << 20
"""Of the memory, while a recording of rosbag2 is read."""
MAX_EXPANSION = 100
ALWAYS_BYTES = 1 << 30
"""A file of rosbag2 that is compressed as a whole may expand to this size, and by this factor."""
MAX_WAITING = 2000
"""Messages that wait to be put in order."""


class Found(NamedTuple):
    """A topic of a recording."""

    msgtype: str
    messages: int


class Source(ABC):
    """One recording."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.problem = ""
        """Why the recording ends early; empty if it does not. Valid after all messages have been read."""
        self.set_back = 0
        """How often the clock was set back; likewise."""

    @abstractmethod
    def topics(self) -> dict[str, Found]:
        """Return the topics with ROS 2 messages in CDR."""

    @abstractmethod
    def messages(self, wanted: Collection[str]) -> Generator[Recorded]:
        """Yield the messages of some topics, in the order of the file."""

    def in_order(self, wanted: Collection[str]) -> Generator[Recorded]:
        """Yield the messages of some topics in order of time; one that is later than that has the time of the last."""
        waiting: list[tuple[int, int, Recorded]] = []
        newest_ns = last_ns = shift_ns = 0
        for number, message in enumerate(self.messages(wanted)):
            if message.log_time_ns + shift_ns < newest_ns - SET_BACK_S * 1e9:
                self.set_back += 1
                shift_ns = newest_ns + round(PAUSE_S * 1e9) - message.log_time_ns
            time_ns = message.log_time_ns + shift_ns
            newest_ns = max(newest_ns, time_ns)
            heappush(waiting, (time_ns, number, message))
            while waiting[0][0] < newest_ns - REORDER_S * 1e9 or len(waiting) > MAX_WAITING:
                last_ns = max(last_ns, waiting[0][0])
                yield heappop(waiting)[2]._replace(log_time_ns=last_ns)
        while waiting:
            last_ns = max(last_ns, waiting[0][0])
            yield heappop(waiting)[2]._replace(log_time_ns=last_ns)


class _Mcap(Source):
    """A file. Its messages are read without its index, up to where it may be truncated."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._reader = RecordingReader(path)

    def topics(self) -> dict[str, Found]:
        return self._index() or _counted(self._reader.messages())

    def _index(self) -> dict[str, Found]:
        """Return the topics by the index at the end of the file; none if it has no valid index."""
        schemas: dict[int, Schema] = {}
        channels: dict[int, Channel] = {}
        counts: dict[int, int] | None = None
        try:
            for record in self._reader.summary():
                match record:
                    case Schema():
                        schemas[record.id] = record
                    case Channel():
                        channels[record.id] = record
                    case Statistics():
                        counts = record.channel_message_counts
                    case _:
                        pass
        except Exception:  # noqa: BLE001 - a damaged index can raise any exception
            return {}
        if counts is None:
            return {}
        found: dict[str, Found] = {}
        for number, channel in channels.items():
            schema = schemas.get(channel.schema_id)
            if channel.message_encoding == MESSAGE_ENCODING and schema is not None:
                before = found[channel.topic].messages if channel.topic in found else 0
                found[channel.topic] = Found(schema.name, before + counts.get(number, 0))
        return found

    def messages(self, wanted: Collection[str]) -> Generator[Recorded]:
        yield from (message for message in self._reader.messages() if message.topic in wanted)
        if self._reader.cut:
            self.problem = "its end is missing or damaged"


class BlackBoxSource(Source):
    """A black box: what the law read and decided, as messages."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        with damage_of(path):
            self.law = BlackBoxReader(path).law

    def topics(self) -> dict[str, Found]:
        counts = _counted(self._all())
        self.problem = ""  # it is found again
        return counts

    def messages(self, wanted: Collection[str]) -> Generator[Recorded]:
        yield from (message for message in self._all() if message.topic in wanted)

    def _all(self) -> Generator[Recorded]:
        try:
            yield from messages(self.path)
        except IncidentError as error:
            self.problem = str(error)


class _Rosbag2(Source):
    """A SQLite file of rosbag2, or a folder with `metadata.yaml`."""

    @contextmanager
    def _opened(self) -> Generator[Reader]:
        """Open the recording; what it expands to is bounded in memory, and on the disk of temporary files.

        Raises:
            Exception: it cannot be read.
        """
        within = (
            [one for one in self.path.iterdir() if not one.is_dir()] if self.path.is_dir() else [self.path]
        )
        for file in within:
            open_file(file).close()
        if self.path.is_dir() and len(read_text(self.path / METADATA)) > MAX_METADATA:
            raise ValueError(f"{METADATA} is larger than {MAX_METADATA >> 10} KiB")
        size = sum(file.stat().st_size for file in within)
        with (
            bounded_growth(MAX_GROWTH_BYTES, ALWAYS_BYTES + MAX_EXPANSION * size),
            Reader(self.path) as reader,
        ):
            yield reader

    def topics(self) -> dict[str, Found]:
        try:
            with self._opened() as reader:
                found: dict[str, Found] = {}
                for one in reader.connections:
                    before = found[one.topic].messages if one.topic in found else 0
                    found[one.topic] = Found(one.msgtype, before + one.msgcount)
                return found
        except Exception as error:  # a damaged database or metadata can raise any exception
            what = "the folder of" if self.path.is_dir() else "a file of"
            raise DeployError(
                f"{self.path} cannot be read as {what} a rosbag2 recording ({_short(error)}): "
                "name an .mcap file, a .db3 file, or a folder with metadata.yaml"
            ) from error

    def messages(self, wanted: Collection[str]) -> Generator[Recorded]:
        try:
            with self._opened() as reader:
                chosen = [one for one in reader.connections if one.topic in wanted]
                for connection, time_ns, payload in reader.messages(chosen) if chosen else ():
                    if not 0 <= time_ns <= MAX_TIME_NS:
                        raise ValueError(f"a message at {time_ns} ns")  # noqa: TRY301 - ends the reading
                    yield Recorded(connection.topic, connection.msgtype, time_ns, 0, bytes(payload))
        except Exception as error:  # noqa: BLE001 - as above
            self.problem = f"the rest cannot be read ({_short(error)})"


def open_source(path: Path) -> Source:
    """Open a recording: a black box by the end of its name, a .db3 file or a folder of rosbag2, else an MCAP file.

    Raises:
        DeployError: there is no such file or folder, or it is not a recording.
    """
    if path.suffix in COMPRESSED and path.is_file():
        raise DeployError(f"{path} is compressed: name the folder with its metadata.yaml")
    if path.name.endswith(SUFFIX):
        return BlackBoxSource(path)
    if path.is_dir() or (path.suffix == ".db3" and path.is_file()):
        return _Rosbag2(path)
    return _Mcap(path)


def _counted(messages: Iterable[Recorded]) -> dict[str, Found]:
    found: dict[str, Found] = {}
    for message in messages:
        before = found[message.topic].messages if message.topic in found else 0
        found[message.topic] = Found(message.msgtype, before + 1)
    return found


def _short(error: Exception) -> str:
    return (str(error) or type(error).__name__).replace("\n", " ")[:200].rstrip(".")
