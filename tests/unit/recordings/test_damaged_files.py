"""Every file that a command reads: any content gives a result or one sentence, and nothing that a terminal obeys."""

import gzip
import json
import os
import resource
import sqlite3
import struct
import tracemalloc
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any, cast

import lz4.frame
import pytest
import zstandard
from mcap.opcode import Opcode
from mcap.records import Chunk, Footer
from typer.testing import CliRunner, Result

from lifeline.cli.app import app
from recordings.incidents.commands import Series, plot
from recordings.judge import source
from recordings.recording import MAGIC, MAX_CHUNK_BYTES, Recorded, RecordingReader, RecordingWriter
from tests.fuzz.files import feed, fuzz_files, readers
from tests.unit.recordings.judge.recorded import drive, write_rosbag2
from tests.unit.recordings.test_incident import stopped
from tests.unit.supervisor.blackbox.test_reader import rewrite
from wire.messages import Twist

Change = Callable[[list[dict[str, Any]]], object]
COMMANDS = (
    ("incidents", "show"),
    ("incidents", "show", "--json"),
    ("incidents", "export"),
    ("replay-decision",),
    ("replay-decision", "--json"),
    ("judge",),
)


def first_step(lines: list[dict[str, Any]]) -> dict[str, Any]:
    return next(line for line in lines if "inputs" in line)


def at(lines: list[dict[str, Any]], *path: Any) -> None:  # noqa: ANN401 - keys, then any JSON value
    """Replace one value of the header, the first state or the first step by the last part of the path."""
    *parts, key, value = path
    place: Any = {"header": lines[0], "state": lines[1]["state"], **first_step(lines)}
    for part in parts:
        place = place[part]
    place[key] = value


def _scan(lines: list[dict[str, Any]]) -> dict[str, Any]:
    return first_step(lines)["inputs"]["scans"][0]


DAMAGE: dict[str, Change] = {
    "a null lidar": lambda lines: at(lines, "header", "config", "lidars", [None]),
    "a null hull": lambda lines: at(lines, "header", "config", "hull", None),
    "a null mode": lambda lines: at(lines, "decision", "mode", None),
    "a null reason": lambda lines: at(lines, "decision", "reasons", [None]),
    "a null velocity": lambda lines: at(lines, "decision", "output", [None, None]),
    "a null scan": lambda lines: at(lines, "inputs", "scans", [None]),
    "null ranges": lambda lines: _scan(lines).update(ranges=None),
    "ranges of texts": lambda lines: _scan(lines)["ranges"].update(dtype="<U1"),
    "a shape beyond 63 bits": lambda lines: _scan(lines)["ranges"].update(shape=[2**63]),
    "a lidar that there is not": lambda lines: _scan(lines).update(lidar=7),
    "a lidar beyond 63 bits": lambda lines: _scan(lines).update(lidar=2**63),
    "a null source": lambda lines: at(lines, "state", "interlock", "sources", [None]),
    "no source": lambda lines: at(lines, "state", "interlock", "sources", []),
    "no sight": lambda lines: at(lines, "state", "sight", "lidars", []),
    "a time that is no number": lambda lines: at(lines, "now_s", "NaN"),
    "a null time": lambda lines: at(lines, "now_s", None),
    "a number of 401 digits": lambda lines: at(lines, "now_s", 10**400),
    "deep lists": lambda lines: at(lines, "decision", "detail", json.loads("[" * 500 + "]" * 500)),
    "a hull without radius": lambda lines: at(lines, "header", "config", "hull", "radius_m", 0.0),
    "infinite limits": lambda lines: lines[0]["config"].update(
        max_linear_m_s="Infinity", max_angular_rad_s="Infinity"
    ),
    "null counts": lambda lines: lines[0].update(left_out_for_memory=None, left_out_for_file_size="x"),
    "an infinite stop": lambda lines: lines[0]["stops"][0].update(now_s="Infinity"),
}
"""Changes of a valid black box; each was a traceback of at least one command, or is beside one."""
QUICK = ("a null hull", "no source", "deep lists", "an infinite stop")
"""Those that `make test` tries: in each, seven commands read the file."""


@pytest.fixture(scope="module")
def valid(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return stopped(tmp_path_factory.mktemp("valid"))


def run(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments))


def assert_a_result_or_a_sentence(result: Result) -> None:
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    assert result.exit_code in {0, 1, 2}
    if result.exit_code == 2:
        assert result.stderr.startswith("lifeline: ")
        assert result.stderr.count("\n") == 1
    assert "Traceback" not in result.output


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    "change",
    [
        pytest.param(change, id=what, marks=() if what in QUICK else pytest.mark.long)
        for what, change in DAMAGE.items()
    ],
)
def test_a_damaged_black_box_gives_rows_or_one_sentence_and_hides_no_other(
    tmp_path: Path, valid: Path, change: Change
) -> None:
    (tmp_path / "blackbox").mkdir()
    (tmp_path / "blackbox" / valid.name).write_bytes(valid.read_bytes())
    bad = tmp_path / "blackbox" / "20260704T110000.000Z-OBSTACLE.jsonl.gz"
    bad.write_bytes(valid.read_bytes())
    rewrite(bad, change)
    for command in COMMANDS:
        out = [str(tmp_path / "out.mcap")] if command[-1] == "export" else []
        assert_a_result_or_a_sentence(run(*command, str(bad), *out))
        (tmp_path / "out.mcap").unlink(missing_ok=True)
    listed = run("incidents", "list", "--state-dir", str(tmp_path))
    assert listed.exit_code == 0, listed.output
    assert "20260704T110000" in listed.stdout
    assert "20260704T120000" in listed.stdout
    _, other = json.loads(run("incidents", "list", "--state-dir", str(tmp_path), "--json").stdout)
    assert (other["reasons"], other["problem"]) == (["OBSTACLE", "COMMAND_TIMEOUT", "SCAN_STALE"], None)


def test_values_that_contradict_each_other_are_named_as_damage(tmp_path: Path) -> None:
    path = stopped(tmp_path)
    rewrite(path, DAMAGE["no sight"])
    result = run("replay-decision", str(path))
    assert result.exit_code == 2
    assert "is damaged: " in result.stderr


def test_names_of_a_black_box_reach_the_terminal_printable_and_without_markup(tmp_path: Path) -> None:
    path = stopped(tmp_path)
    hostile = "\x1b]0;x\x07[red]name[/]"

    def change(lines: list[dict[str, Any]]) -> None:
        lines[0]["stops"][0]["reasons"] = [hostile]
        lines[0]["python"] = hostile
        lines[-2]["decision"]["scale"] = 0.123

    rewrite(path, change)
    result = run("replay-decision", str(path))
    assert result.exit_code == 1, result.output
    assert result.stdout.count("?]0;x?[red]name[/]") == 2
    assert "\x1b" not in result.stdout


def test_a_value_beyond_all_measures_is_not_drawn() -> None:
    text = plot("speed", [0.0, 1.0], [Series("measured", "o", "", [1e308, -1e308])], width=40, height=4).plain
    assert "o" not in text.partition("measured")[2]


def test_a_recording_ends_at_a_time_that_no_tool_accepts(tmp_path: Path) -> None:
    path = tmp_path / "r.mcap"
    writer = RecordingWriter(path)
    writer.write(Recorded("/robot/cmd_vel", Twist.__msgtype__, (1 << 63) - 1, 0, b""))
    writer.write(Recorded("/robot/cmd_vel", Twist.__msgtype__, 1 << 63, 1, b""))
    writer.close()
    reader = RecordingReader(path)
    assert [message.sequence for message in reader.messages()] == [0]
    assert reader.cut


@pytest.mark.parametrize(
    "text",
    ["a = " + "[" * 100_000, "[bus]\nnamespace = " + "9" * 5000, "[bus]\nnamespace = '" + "x" * 70_000 + "'"],
)
def test_a_configuration_that_is_nested_or_long_is_refused_in_a_short_sentence(
    tmp_path: Path, text: str
) -> None:
    path = tmp_path / "robot.toml"
    path.write_text(text)
    result = run("check", str(path))
    assert result.exit_code == 2, result.output
    assert len(result.stderr) < 1000
    assert "Traceback" not in result.stderr


@pytest.mark.long
def test_damaged_files_of_every_kind_are_read_or_refused(tmp_path: Path) -> None:
    assert [(found.reader, found.what) for found in fuzz_files(0, 12, tmp_path)] == []


@pytest.mark.proof
def test_many_damaged_files_of_every_kind_are_read_or_refused(tmp_path: Path) -> None:
    assert [(found.reader, found.what) for found in fuzz_files(1, 200, tmp_path)] == []


def test_a_reader_that_raises_is_found(tmp_path: Path) -> None:
    box, *_ = readers(tmp_path / "seeds")

    def raise_it(path: Path) -> object:
        return json.loads(gzip.decompress(path.read_bytes()))

    def print_it(path: Path) -> object:
        return print("\x1b[31m", path.name)

    broken = box._replace(read=raise_it)
    assert "JSONDecodeError" in feed(broken, tmp_path, box.seed)
    printing = box._replace(read=print_it)
    assert "the terminal is sent" in feed(printing, tmp_path, box.seed)


def _record(opcode: int, body: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(body)) + body


def _chunk(compression: bytes, size: int, content: bytes) -> bytes:
    head = struct.pack("<QQQII", 0, 0, size, 0, len(compression)) + compression
    return _record(Opcode.CHUNK, head + struct.pack("<Q", len(content)) + content)


HEADER = MAGIC + _record(Opcode.HEADER, struct.pack("<II", 0, 0))
LARGE = bytes(MAX_CHUNK_BYTES + 1)


def _grown_bytes(path: Path) -> int:
    """Return the peak of the memory that reading a file takes, as Python counts it."""
    tracemalloc.start()
    try:
        list(RecordingReader(path).messages())
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("compression", [b"", b"zstd", b"lz4"])
def test_a_chunk_that_claims_to_be_large_is_refused(tmp_path: Path, compression: bytes) -> None:
    path = tmp_path / "r.mcap"
    path.write_bytes(HEADER + _chunk(compression, MAX_CHUNK_BYTES + 1, b"x"))
    result = run("judge", str(path))
    assert (result.exit_code, result.stderr.count("\n")) == (2, 1)
    assert "has a chunk of 64 MiB, more than 64 MiB" in result.stderr


@pytest.mark.parametrize("size", [1000, MAX_CHUNK_BYTES])
def test_a_chunk_that_is_larger_than_it_claims_is_not_expanded_beyond_that(tmp_path: Path, size: int) -> None:
    path = tmp_path / "r.mcap"
    for compression, content in (
        (b"zstd", zstandard.compress(LARGE)),
        (b"lz4", cast("Any", lz4.frame).compress(LARGE)),
    ):
        path.write_bytes(HEADER + _chunk(compression, size, content))
        reader = RecordingReader(path)
        assert list(reader.messages()) == []
        assert reader.cut
        if size < MAX_CHUNK_BYTES:
            assert _grown_bytes(path) < MAX_CHUNK_BYTES // 4


@pytest.mark.parametrize("opcode", [Opcode.MESSAGE, Opcode.ATTACHMENT, 0x7F])
def test_a_record_that_claims_to_be_large_is_not_read(tmp_path: Path, opcode: int) -> None:
    path = tmp_path / "r.mcap"
    path.write_bytes(HEADER + struct.pack("<BQ", opcode, 3 * MAX_CHUNK_BYTES) + b"\xff" * 32)
    with path.open("r+b") as file:
        file.truncate(4 * MAX_CHUNK_BYTES)
    assert _grown_bytes(path) < MAX_CHUNK_BYTES // 4


def test_an_index_that_leads_to_a_chunk_expands_nothing(tmp_path: Path) -> None:
    path = tmp_path / "r.mcap"
    footer = _record(Opcode.FOOTER, struct.pack("<QQI", len(HEADER), 0, 0))
    path.write_bytes(HEADER + _chunk(b"zstd", 1000, zstandard.compress(LARGE)) + footer + MAGIC)
    assert [type(one) for one in RecordingReader(path).summary()] == [Chunk, Footer]


def test_a_pipe_among_the_files_of_rosbag2_is_not_waited_for(tmp_path: Path) -> None:
    bag = write_rosbag2(tmp_path / "bag", drive(0.5))
    for name in ("bag.db3", "metadata.yaml"):
        content = (bag / name).read_bytes()
        (bag / name).unlink()
        os.mkfifo(bag / name)
        result = run("judge", str(bag))
        assert (result.exit_code, result.stderr.count("\n")) == (2, 1)
        assert "it is a pipe or a device, not a file" in result.stderr
        (bag / name).unlink()
        (bag / name).write_bytes(content)


def test_the_metadata_of_rosbag2_has_a_limit(tmp_path: Path) -> None:
    bag = write_rosbag2(tmp_path / "bag", drive(0.5))
    with (bag / "metadata.yaml").open("a") as file:
        file.write("x: [" + "[]," * 100_000 + "]\n")
    assert "metadata.yaml is larger than 256 KiB" in run("judge", str(bag)).stderr


@pytest.mark.parametrize("mode", ["FILE", "MESSAGE"])
def test_what_expands_without_end_is_refused_in_rosbag2(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, mode: str
) -> None:
    monkeypatch.setattr(source, "MAX_GROWTH_BYTES", 32 << 20)
    monkeypatch.setattr(source, "ALWAYS_BYTES", 1 << 20)
    bag = write_rosbag2(tmp_path / "bag", drive(0.5))
    metadata, database = bag / "metadata.yaml", bag / "bag.db3"
    text = metadata.read_text().replace("compression_format: ''", "compression_format: zstd")
    packed = zstandard.compress(LARGE)
    if mode == "FILE":
        text = text.replace("bag.db3", "bag.db3.zstd")
        database.unlink()
        database.with_name("bag.db3.zstd").write_bytes(packed)
    else:
        with closing(sqlite3.connect(database)) as connection, connection:
            connection.execute("UPDATE messages SET data = ?", (packed,))
    metadata.write_text(text.replace("compression_mode: ''", f"compression_mode: {mode}"))
    before = [resource.getrlimit(kind) for kind in (resource.RLIMIT_DATA, resource.RLIMIT_FSIZE)]
    assert_a_result_or_a_sentence(result := run("judge", str(bag)))
    assert result.exit_code == 2
    assert [resource.getrlimit(kind) for kind in (resource.RLIMIT_DATA, resource.RLIMIT_FSIZE)] == before
