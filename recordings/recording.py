"""Writes and reads recordings: MCAP files as rosbag2 writes them.

The MCAP writer buffers messages in a chunk. The recorder calls `flush` each second, which finishes the chunk, so
that at most one second is lost if it is killed. The reader starts at the beginning and needs no index, so that a
truncated file is readable up to where it was cut. Its memory is bounded by `MAX_CHUNK_BYTES`.
"""

import zlib
from collections.abc import Iterator
from io import SEEK_END, BufferedReader, BytesIO
from pathlib import Path
from typing import Any, NamedTuple, cast

import lz4.frame
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Footer, McapRecord, Message, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer
from zstandard import ZstdDecompressor

from deploy.stack.errors import DeployError
from wire.foreign import open_file
from wire.messages import definition

MAGIC = b"\x89MCAP0\r\n"
PROFILE, LIBRARY = "ros2", "lifeline"
MESSAGE_ENCODING, SCHEMA_ENCODING = "cdr", "ros2msg"
NO_QOS = "[]"
"""What all versions of rosbag2 write if no QoS was offered; rosbag2 then plays with its default QoS."""
MAX_CHUNK_BYTES = 64 << 20
"""Of a chunk, compressed or not, and of any other record. rosbag2 writes chunks of about 1 MB, or of one larger message."""
FOOTER_BYTES = 1 + 8 + 20 + len(MAGIC)
"""From the beginning of the last record to the end of the file."""
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
            with open_file(path) as file:
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
        with _Bounded(self.path) as file:
            try:
                for record in _unpacked(StreamReader(file, validate_crcs=True, emit_chunks=True).records):
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
            except RecordingError as error:
                raise RecordingError(f"{self.path} {error}: record it again with smaller chunks") from error
            except Exception:  # noqa: BLE001 - a truncated record can raise any exception
                self.cut = True

    def summary(self) -> Iterator[McapRecord]:
        """Yield the records of the index at the end of the file; none if it has no index.

        Raises:
            Exception: the index is damaged.
        """
        with _Bounded(self.path) as file:
            file.seek(-FOOTER_BYTES, SEEK_END)
            footer = next(StreamReader(file, skip_magic=True, emit_chunks=True).records)
            if isinstance(footer, Footer) and footer.summary_start:
                file.seek(footer.summary_start)
                yield from StreamReader(file, skip_magic=True, emit_chunks=True).records


class _Bounded(BufferedReader):
    """A file of which no part larger than `MAX_CHUNK_BYTES` is read at once, whatever length a record claims."""

    def __init__(self, path: Path) -> None:
        super().__init__(open_file(path).detach())  # pyright: ignore[reportAttributeAccessIssue, reportUnknownMemberType, reportUnknownArgumentType]

    def read(self, size: int | None = -1, /) -> bytes:
        if size is None or not 0 <= size <= MAX_CHUNK_BYTES:
            raise ValueError(f"a part of {size} bytes")
        return super().read(size)


def _unpacked(records: Iterator[McapRecord]) -> Iterator[McapRecord]:
    """Yield the records, with those of each chunk in its place."""
    for record in records:
        if isinstance(record, Chunk):
            yield from _records_of(record)
        else:
            yield record


def _records_of(chunk: Chunk) -> Iterator[McapRecord]:
    if chunk.uncompressed_size > MAX_CHUNK_BYTES:
        raise RecordingError(
            f"has a chunk of {chunk.uncompressed_size >> 20} MiB, more than {MAX_CHUNK_BYTES >> 20} MiB"
        )
    content = _content_of(chunk)
    if chunk.uncompressed_crc not in (0, zlib.crc32(content)):
        raise ValueError("the checksum of a chunk is wrong")
    stream = ReadDataStream(BytesIO(content))
    while stream.count < len(content):
        opcode, length = stream.read1(), stream.read8()
        match opcode:
            case Opcode.SCHEMA:
                yield Schema.read(stream)
            case Opcode.CHANNEL:
                yield Channel.read(stream)
            case Opcode.MESSAGE:
                yield Message.read(stream, length)
            case _:
                raise ValueError(f"a record {opcode} in a chunk")


def _content_of(chunk: Chunk) -> bytes:
    """Return the uncompressed records of a chunk; what it holds beyond its size is not expanded."""
    size = chunk.uncompressed_size
    match chunk.compression:
        case "zstd":
            content = ZstdDecompressor().stream_reader(chunk.data).read(size + 1)
        case "lz4":
            unpacker = cast("Any", lz4.frame).LZ4FrameDecompressor()
            content = cast("bytes", unpacker.decompress(chunk.data, max_length=size + 1))
        case _:
            content = chunk.data
    if len(content) != size:
        raise ValueError(f"a chunk of {size} bytes has another size")
    return content


def exists(path: Path) -> RecordingError:
    """Return the error that the file exists."""
    return RecordingError(f"{path} already exists: choose another file")
