"""A recording: an MCAP file as rosbag2 writes it, that loses a second at most when its writer is killed.

MCAP keeps what it writes in a chunk until that is finished: a chunk is finished, and the file flushed, each
second (whoever writes calls `flush`). Reading goes from the start and needs no index, so that a file that was
cut short reads up to where it was cut.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from mcap.records import Channel, Chunk, Message, Schema
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import CompressionType, Writer

from deploy.stack.errors import DeployError
from wire.messages import definition

MAGIC = b"\x89MCAP0\r\n"
PROFILE, LIBRARY = "ros2", "lifeline"
MESSAGE_ENCODING, SCHEMA_ENCODING = "cdr", "ros2msg"
NO_QOS = "[]"
"""What rosbag2 writes where nothing was offered, in all its versions alike; it plays that with its default QoS."""
MAX_SEQUENCE = 1 << 32


class RecordingError(DeployError):
    """A recording cannot be written or read; the message says why."""


class Recorded(NamedTuple):
    """One message of a recording."""

    topic: str
    """With a leading slash, as ROS names it: /robot/odom."""
    msgtype: str
    log_time_ns: int
    """When it arrived, by the wall clock."""
    sequence: int
    payload: bytes


class RecordingWriter:
    """Writes one file.

    Args:
        path: must not exist.

    Raises:
        RecordingError: it exists, or cannot be made.
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
        """Of the file, without what is still to be flushed."""
        return self._file.tell()

    def write(self, message: Recorded) -> None:
        """Add a message.

        Raises:
            OSError: the file takes no more.
        """
        channel = self._channels.get(message.topic)
        if channel is None:
            channel = self._add_channel(message.topic, message.msgtype)
        self._writer.add_message(
            channel,
            log_time=message.log_time_ns,
            data=message.payload,
            # A sender's stamp is of its own monotonic clock: nothing that a reader could use.
            publish_time=message.log_time_ns,
            sequence=message.sequence % MAX_SEQUENCE,
        )

    def flush(self) -> None:
        """What was written until now survives this process.

        Raises:
            OSError: the file takes no more.
        """
        self._writer.flush()

    def close(self) -> None:
        """Finish the file with its index.

        Raises:
            OSError: the file takes no more; it can be read up to there.
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
    """Reads one file from its start to its end, or to where it was cut.

    Args:
        path: of an MCAP file with ROS 2 messages; rosbag2's own will do as well.

    Raises:
        RecordingError: there is no such file, or it is no MCAP file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.cut = False
        """Its end is missing or damaged; known once everything has been read."""
        try:
            with path.open("rb") as file:
                magic = file.read(len(MAGIC))
        except OSError as error:
            raise RecordingError(f"cannot read {path} ({error.strerror}): name a recording") from error
        if magic != MAGIC:
            raise RecordingError(f"{path} is no MCAP file: name one that `lifeline record` wrote")

    def messages(self) -> Iterator[Recorded]:
        """Every message, in the order of the file."""
        schemas: dict[int, Schema] = {}
        channels: dict[int, Channel] = {}
        with self.path.open("rb") as file:
            size = self.path.stat().st_size
            reader = StreamReader(file, emit_chunks=True, record_size_limit=size)
            records = iter(reader.records)
            while True:
                try:
                    record = next(records, None)
                    inner = (
                        breakup_chunk(record, validate_crc=True) if isinstance(record, Chunk) else [record]
                    )
                except Exception:  # noqa: BLE001 - half a record raises whatever its bytes provoke
                    self.cut = True
                    return
                if record is None:
                    return
                for item in inner:
                    match item:
                        case Schema():
                            schemas[item.id] = item
                        case Channel():
                            channels[item.id] = item
                        case Message(channel_id=number) if number in channels:
                            channel = channels[number]
                            if channel.message_encoding == MESSAGE_ENCODING and channel.schema_id in schemas:
                                yield Recorded(
                                    channel.topic,
                                    schemas[channel.schema_id].name,
                                    item.log_time,
                                    item.sequence,
                                    item.data,
                                )
                        case _:
                            pass


def exists(path: Path) -> RecordingError:
    """The refusal to write over a file."""
    return RecordingError(f"{path} exists, and is not overwritten: choose another file")
