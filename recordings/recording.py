"""Writes and reads recordings: MCAP files as rosbag2 writes them.

The MCAP writer buffers messages in a chunk. The recorder calls `flush` each second, which finishes the chunk, so
that at most one second is lost if it is killed. The reader starts at the beginning and needs no index, so that a
truncated file is readable up to where it was cut.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from mcap.records import Channel, Message, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer

from deploy.stack.errors import DeployError
from wire.messages import definition

MAGIC = b"\x89MCAP0\r\n"
PROFILE, LIBRARY = "ros2", "lifeline"
MESSAGE_ENCODING, SCHEMA_ENCODING = "cdr", "ros2msg"
NO_QOS = "[]"
"""What all versions of rosbag2 write if no QoS was offered; rosbag2 then plays with its default QoS."""
MAX_SEQUENCE = 1 << 32
MAX_TIME_NS = (1 << 63) - 1
"""The largest time that tools for recordings accept; MCAP has one bit more."""


class RecordingError(DeployError):
    """A recording cannot be written or read; the message says why."""


class Recorded(NamedTuple):
    """One message of a recording."""

    topic: str
    """The ROS name, with a leading slash: /robot/odom."""
    msgtype: str
    log_time_ns: int
    """Time of arrival by the wall clock."""
    sequence: int
    payload: bytes


class RecordingWriter:
    """Writes one file.

    Args:
        path: must not exist.

    Raises:
        RecordingError: the file exists or cannot be created.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self._file = path.open("xb")
        except FileExistsError as error:
            raise exists(path) from error
        except OSError as error:
            raise RecordingError(f"cannot write {path} ({error.strerror}): choose another file") from error
        self._writer = Writer(self._file, compression=CompressionType.ZSTD)
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._writer.start(PROFILE, LIBRARY)

    @property
    def size_bytes(self) -> int:
        """Size of the file, without unflushed data."""
        return self._file.tell()

    def write(self, message: Recorded) -> None:
        """Add a message.

        Raises:
            OSError: the write fails.
        """
        channel = self._channels.get(message.topic)
        if channel is None:
            channel = self._add_channel(message.topic, message.msgtype)
        self._writer.add_message(
            channel,
            log_time=message.log_time_ns,
            data=message.payload,
            # A sender's stamp uses its own monotonic clock, which a reader cannot use.
            publish_time=message.log_time_ns,
            sequence=message.sequence % MAX_SEQUENCE,
        )

    def flush(self) -> None:
        """Write all messages so far to the file, so that they survive the death of this process.

        Raises:
            OSError: the write fails.
        """
        self._writer.flush()

    def close(self) -> None:
        """Write the index and close the file.

        Raises:
            OSError: the write fails; the file is readable up to there.
        """
        try:
            self._writer.finish()
        finally:
            self._file.close()

    def _add_channel(self, topic: str, msgtype: str) -> int:
        schema = self._schemas.get(msgtype)
        if schema is None:
            schema = self._writer.register_schema(msgtype, SCHEMA_ENCODING, definition(msgtype).text.encode())
            self._schemas[msgtype] = schema
        metadata = {"offered_qos_profiles": NO_QOS, "topic_type_hash": definition(msgtype).hash}
        channel = self._writer.register_channel(topic, MESSAGE_ENCODING, schema, metadata)
        self._channels[topic] = channel
        return channel


class RecordingReader:
    """Reads one file from its start to its end, or to where it was truncated.

    Args:
        path: of an MCAP file with ROS 2 messages; rosbag2's files also work.

    Raises:
        RecordingError: the file cannot be read, or is not an MCAP file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.cut = False
        """Whether the end is missing or damaged; valid after all messages have been read."""
        try:
            if path.is_fifo():
                raise RecordingError(f"{path} is a pipe: name a recording")
            with path.open("rb") as file:
                magic = file.read(len(MAGIC))
        except OSError as error:
            raise RecordingError(f"cannot read {path} ({error.strerror}): name a recording") from error
        if magic != MAGIC:
            raise RecordingError(
                f"{path} is not an MCAP file: name a recording, such as a file that `lifeline record` wrote"
            )

    def messages(self) -> Iterator[Recorded]:
        """Yield every message, in the order of the file."""
        schemas: dict[int, Schema] = {}
        channels: dict[int, Channel] = {}
        with self.path.open("rb") as file:
            size = self.path.stat().st_size
            try:
                for record in StreamReader(file, validate_crcs=True, record_size_limit=size).records:
                    match record:
                        case Schema():
                            schemas[record.id] = record
                        case Channel():
                            channels[record.id] = record
                        case Message(log_time=time_ns) if time_ns > MAX_TIME_NS:
                            raise ValueError(f"a message at {time_ns} ns")  # noqa: TRY301 - ends the reading
                        case Message(channel_id=number) if number in channels:
                            channel = channels[number]
                            schema = schemas.get(channel.schema_id)
                            if channel.message_encoding == MESSAGE_ENCODING and schema is not None:
                                time_ns, sequence = record.log_time, record.sequence
                                yield Recorded(channel.topic, schema.name, time_ns, sequence, record.data)
                        case _:
                            pass
            except Exception:  # noqa: BLE001 - a truncated record can raise any exception
                self.cut = True


def exists(path: Path) -> RecordingError:
    """Return the error that the file exists."""
    return RecordingError(f"{path} already exists: choose another file")
