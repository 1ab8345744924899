"""Damage the files that Lifeline reads: any content gives a result or one sentence, and nothing that a terminal obeys.

The seeds are files that Lifeline writes or ships. Values of JSON and TOML are replaced by hostile ones, lines and bytes are
lost, repeated and changed.
"""

import gzip
import io
import json
import re
import warnings
from collections.abc import Callable, Iterator
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass, replace
from pathlib import Path
from random import Random
from typing import Any, NamedTuple, cast

from rich.console import Console

from deploy.keys.commands import show as show_keys
from deploy.keys.folder import Folder
from deploy.keys.register import Issued, Register, rows, to_json
from deploy.stack.errors import DeployError
from deploy.stack.launch import Launch
from deploy.stack.statedir import LockedError, StateDir
from faults.report.page import write_report
from faults.report.table import print_results
from faults.trial import BrokenPromise, Injected, Provenance, Sample, Trial
from faults.trial_file import read_trials
from lifeline.check.check import check
from lifeline.path import read_poses
from lifeline.view.scene import read_source
from recordings.incidents.commands import export, show, show_list
from recordings.incidents.incident import damage_of
from recordings.incidents.replay import replay_decision
from recordings.judge import page
from recordings.judge.choice import Named
from recordings.judge.judge import judge
from recordings.recording import RecordingReader
from sim.layout import LayoutError, read_layout
from supervisor.blackbox.recorder import BlackBox
from supervisor.config import SupervisorSection
from supervisor.estop_record import pressed_by
from supervisor.law.model import Inputs, Odometry
from supervisor.law.reckoning import Velocity
from tests.unit.recordings.judge.recorded import drive, write_mcap, write_rosbag2
from tests.unit.supervisor.blackbox.black_boxes import NOON_UTC_S, Drive, WriterAtOnce
from tests.unit.supervisor.law.law_harness import CONFIG, FORWARD, TICK_S
from wire.host.config import BusSection, ConfigError
from wire.roles import Role

ROOT = Path(__file__).resolve().parents[2]
SETTINGS = b"""
[ros2]
scan = "/scan"
odom = "/odom"
"""

HOSTILE = (
    "null",
    "true",
    "NaN",
    "-Infinity",
    '"NaN"',
    '"Infinity"',
    "1e999",
    "1e308",
    "-1e308",
    "5e-324",
    "0",
    "-1",
    "7",
    "1.5",
    str(2**63),
    str(-(2**64)),
    "1" + "0" * 400,
    "9" * 5000,
    "[]",
    "{}",
    "[null]",
    "[[1, 2], [3]]",
    "[" * 60 + "]" * 60,
    "[" * 900 + "]" * 900,
    '{"a":' * 900 + "1" + "}" * 900,
    "[" * 100_000,
    '""',
    '"\\u001b]0;x\\u0007 [red]name[/red] [/]"',
    '"\\ud800"',
    '"' + "x" * 70_000 + '"',
)
"""JSON values; those that TOML does not have are damage there."""
LONGEST_SENTENCE = 4000
REFUSALS = (DeployError, ConfigError, LayoutError)
ESCAPE = re.compile(r"[^\n\t -~\u00a0-\ud7ff\ue000-\U0010ffff]")
"""A character that a terminal obeys, or that cannot be written."""


class FileReader(NamedTuple):
    """A reader of one kind of file, and a valid file."""

    name: str
    """The name of the file."""
    seed: bytes
    read: Callable[[Path], object]
    """Reads the whole file, as commands do."""


@dataclass(frozen=True, slots=True)
class FileFinding:
    """A file that a reader did not refuse in one sentence."""

    reader: str
    what: str
    content: bytes


def incident_commands(path: Path) -> None:
    """Run every command that reads a black box."""
    assert show_list(path.parent, as_json=False) == 0
    assert show_list(path.parent, as_json=True) == 0
    out = path.with_name("out.mcap")
    out.unlink(missing_ok=True)

    def replay(path: Path) -> None:
        replay_decision(path)
        replay_decision(path, as_json=True)

    commands: tuple[Callable[[Path], object], ...] = (
        lambda path: show(path, 30.0, as_json=False),
        lambda path: show(path, 30.0, as_json=True),
        lambda path: export(path, out, "robot", as_json=False),
        replay,
        judged,
        draw,
    )
    for command in commands:
        try:
            command(path)
        except DeployError as error:
            sentence(error)


def draw(path: Path) -> None:
    """Draw a file as `lifeline view` does, without its window."""
    with damage_of(path):
        drawn, messages = read_source(path, SupervisorSection(), "robot")
        list(drawn.fixed())
        for message in messages:
            drawn.draw(message.topic, message.log_time_ns * 1e-9, message.payload)


def state_files(path: Path) -> None:
    """Read every file of a state directory."""
    state = StateDir(path.parent)
    launch = Launch.running(state)
    if launch is not None:
        launch.bus.endpoint.partition("/")
        launch.is_started(state)
        launch.section("supervisor", SupervisorSection)
    (path.parent / "lock").write_bytes(path.read_bytes())
    sentence(LockedError(state))
    (path.parent / "estop-robot.latched").write_bytes(path.read_bytes())
    print(pressed_by(path.parent, "robot"))


def judged(path: Path) -> None:
    """Judge a recording as `lifeline judge` does."""
    found = judge(path, None, Named(), print)
    Console().print(*page.page(found))
    print(page.to_json(found))


def recording(path: Path) -> None:
    list(RecordingReader(path).messages())
    draw(path)
    read_poses(path)
    judged(path)


def robot_file(path: Path) -> None:
    check(path)


def register(path: Path) -> None:
    show_keys(rows(Folder(path.parent).register(), 1e9))


def campaign(path: Path) -> None:
    write_report([path], path.with_suffix(".html"))
    print_results(list(read_trials(path)))
    print_results(list(read_trials(path)), as_json=True)


def sentence(error: Exception) -> None:
    """Check that an error is a sentence."""
    text = str(error)
    assert text, f"{error!r} says nothing"
    assert len(text) <= LONGEST_SENTENCE, f"an error of {len(text)} characters: {text[:200]}"


def damaged(random: Random, seed: bytes) -> bytes:
    """Return a file with one to three faults."""
    content = seed
    is_packed = seed[:2] == b"\x1f\x8b"
    if random.random() < (0.1 if is_packed else 0.3):
        return _bytes_damaged(random, content)
    if is_packed:
        content = gzip.decompress(content)
    for _ in range(random.choice((1, 1, 1, 2, 3))):
        lines = content.split(b"\n")
        number = min(random.randrange(len(lines)), random.choice((0, 1, 2, len(lines))), len(lines) - 1)
        if random.random() < 0.9:
            lines[number] = _value_damaged(random, lines[number])
        elif random.random() < 0.5:
            del lines[number]
        else:
            lines.insert(number, random.choice(lines))
        content = b"\n".join(lines)
    return gzip.compress(content, 1) if is_packed else content


def _bytes_damaged(random: Random, content: bytes) -> bytes:
    changed = bytearray(content)
    for _ in range(random.choice((1, 1, 4))):
        at = random.randrange(len(changed) + 1)
        match random.randrange(4):
            case 0:
                del changed[at:]
            case 1:
                del changed[at : at + random.randrange(1, 9)]
            case 2:
                changed[at:at] = bytes(random.randrange(256) for _ in range(random.randrange(1, 9)))
            case _:
                changed[at : at + 1] = bytes([random.randrange(256)])
    return bytes(changed)


def _value_damaged(random: Random, line: bytes) -> bytes:
    """Replace, remove or move one value of a line; TOML's lines are `key = value`."""
    try:
        document = json.loads(line)
    except (ValueError, RecursionError):
        key, equals, _ = line.partition(b"=")
        return (
            key + equals + b" " + random.choice(HOSTILE).encode()
            if equals
            else random.choice(HOSTILE).encode()
        )
    places = list(_places(document))
    if not places:
        return random.choice(HOSTILE).encode()
    container, key = random.choice(places)
    new = random.choice(HOSTILE)
    if random.random() < 0.08:
        del container[key]
        return json.dumps(document).encode()
    if random.random() < 0.1:
        other, other_key = random.choice(places)
        new = json.dumps(other[other_key])
    container[key] = "@@hostile@@"
    return json.dumps(document).replace('"@@hostile@@"', new, 1).encode()


def _places(value: Any) -> Iterator[tuple[Any, Any]]:  # noqa: ANN401 - any JSON
    """Yield the container and the key of every value."""
    keys: list[Any] = []
    if isinstance(value, dict | list):
        keys = list(cast("Any", value if isinstance(value, dict) else range(len(cast("Any", value)))))
    for key in keys:
        yield value, key
        yield from _places(value[key])


def feed(reader: FileReader, directory: Path, content: bytes) -> str:
    """Read a content; return what is wrong, else an empty text."""
    path = directory / reader.name
    path.write_bytes(content)
    said = io.StringIO()
    try:
        with warnings.catch_warnings(), redirect_stdout(said), redirect_stderr(said):
            warnings.simplefilter("error")
            reader.read(path)
    except REFUSALS as error:
        if len(str(error)) > LONGEST_SENTENCE:
            return f"an error of {len(str(error))} characters: {error}"[:300]
    except (Exception, SystemExit) as error:  # noqa: BLE001 - that there is none is what is tested
        return f"{type(error).__name__}: {error}"[:300] + _where(error)
    found = ESCAPE.search(said.getvalue())
    return (
        ""
        if found is None
        else f"the terminal is sent {said.getvalue()[max(0, found.start() - 60) : found.end() + 20]!r}"
    )


def _where(error: BaseException) -> str:
    trace = error.__traceback__
    places: list[str] = []
    while trace is not None:
        places.append(f"{Path(trace.tb_frame.f_code.co_filename).name}:{trace.tb_lineno}")
        trace = trace.tb_next
    return " at " + " ".join(places[-6:])


def readers(directory: Path) -> tuple[FileReader, ...]:
    """Return every reader with its seed; black boxes and recordings are written to the directory."""
    box = _black_box(directory)
    mcap = directory / "seed.mcap"
    with redirect_stdout(io.StringIO()):
        export(box, mcap, "robot", as_json=False)
    any_bag = write_rosbag2(directory / "any_bag", drive(1.5))
    record = Launch(Path("robot.toml"), BusSection().to_bus_config()).to_record()
    issued = Issued("alice", Role.OPERATOR, "robot", (), "12", 2e9)
    registered = Register((issued, replace(issued, name="bob")), {"eve": 1e9})
    return (
        FileReader(box.name, box.read_bytes(), incident_commands),
        FileReader("drive.mcap", mcap.read_bytes(), recording),
        FileReader("any.mcap", write_mcap(directory / "any.mcap", drive(1.5)).read_bytes(), judged),
        FileReader("any.db3", (any_bag / "any_bag.db3").read_bytes(), judged),
        FileReader("robot.toml", (ROOT / "deploy/robot.toml").read_bytes() + SETTINGS, robot_file),
        FileReader("layout.toml", (ROOT / "sim/layouts/warehouse.toml").read_bytes(), read_layout),
        FileReader("stack.json", json.dumps(record | {"pid": 1, "command": "up"}).encode(), state_files),
        FileReader("register.json", json.dumps(to_json(registered)).encode(), register),
        FileReader("trials.jsonl", _campaign(), campaign),
    )


def _black_box(directory: Path) -> Path:
    """Return a black box of half a second in which the robot drives, stops at an object and brakes."""
    writer = WriterAtOnce(directory)
    drive = Drive(BlackBox(CONFIG, writer, window_s=60.0, lidar_topics=("scan",), utc=lambda: NOON_UTC_S))
    drive.hold(0.1)
    drive.hold(0.16, FORWARD)
    drive.stop()
    for i in range(8):
        drive.step(Inputs(odometry=Odometry(Velocity(0.5 - i * 0.5 / 7, 0.0), drive.now_s + TICK_S)))
    drive.box.close()
    return writer.paths[0]


def _campaign() -> bytes:
    fault = Injected(
        fault="kill_source", time_s=1.0, parameters={"for_s": 1.0}, detector="SOURCE_LOST", to_zero_s=0.1
    )
    moment = Sample(time_s=1.0, commanded=(0.5, 0.0), permitted=(0.5, 0.0), true=(0.5, 0.0), clearance_m=1.0)
    trial = Trial(
        mode="virtual", revision="r", seed=1, duration_s=10.0, faults=(fault,), smallest_clearance_m=0.5, contacts=0,
        violations=(BrokenPromise(1, 1.0, "it moved"),), timeline=(moment,),
    )  # fmt: skip
    return "".join(
        f"{one.line()}\n" for one in (trial, trial, Provenance(command="lifeline faults"))
    ).encode()


def fuzz_files(seed: int, count: int, directory: Path, only: str = "") -> list[FileFinding]:
    """Damage the seed of each reader this many times."""
    findings: list[FileFinding] = []
    for reader in readers(directory / "seeds"):
        if only and only not in reader.name:
            continue
        random, place = Random(f"{seed} {reader.name}"), directory / reader.name.replace(".", "_")
        place.mkdir()
        what = feed(reader, place, reader.seed)
        assert not what, f"{reader.name}, undamaged: {what}"
        for _ in range(count):
            content = damaged(random, reader.seed)
            what = feed(reader, place, content)
            if what:
                findings.append(FileFinding(reader.name, what, content))
    return findings
