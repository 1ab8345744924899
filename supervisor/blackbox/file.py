"""Writes a black box, `20260704T101530.123Z-OBSTACLE.jsonl.gz`: gzip with one JSON object per line.

    {"format": "lifeline black box", "version": 2, "stops": […], "config": {…}, …}   the header
    {"state": {…}}                               the law's state before the next step; one each second
    {"now_s": …, "inputs": {…}, "decision": {…}} a step of the law
    …
    {"end": true, "steps": 4812}                 the file is complete

`codec.py` defines the encoding of values. Each second is a separate gzip member. The oldest members are left out
if the file would become too large. `reader.py` reads the file.
"""

import gzip
import json
import marshal
import os
import re
from array import array
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from supervisor.blackbox.codec import codec, record_codec
from supervisor.law.decision import Decision
from supervisor.law.model import Inputs, LawConfig
from supervisor.law.state import State
from supervisor.law.stop_rules import ROUTINE
from wire.ownership import make_directory, open_own, refusal

FORMAT = "lifeline black box"
VERSION = 2
SUFFIX = ".jsonl.gz"
OURS = re.compile(r"\d{8}T\d{6}\.\d{3}Z-(?P<reason>[A-Z_]+)(-\d+)?\.jsonl\.gz")
"""Names of the files that may be deleted; no other file ever is."""

COMPRESSION = 6
MARSHAL_VERSION = 2
"""Version 2: binary floats without object references."""

LAW, STATE, INPUTS = codec(LawConfig), codec(State), codec(Inputs)
DECISION = record_codec(Decision, without=("sources", "stations"))
"""Without sources and stations: they are part of the state and are compared with each recorded state."""


class Steps:
    """Packed steps in one block of memory; thousands of small blocks would fragment the heap."""

    def __init__(self, packed: Sequence[bytes]) -> None:
        self._block = b"".join(packed)
        self._lengths = array("L", map(len, packed))

    def __len__(self) -> int:
        return len(self._lengths)

    def __iter__(self) -> Iterator[bytes]:
        begin = 0
        for length in self._lengths:
            yield self._block[begin : begin + length]
            begin += length


Segment = tuple[bytes, Steps]
"""A packed state and the packed steps that follow it."""

Pause = Callable[[], object]


@dataclass(frozen=True, slots=True)
class Order:
    """A black box to be written."""

    name: str
    """Without the suffix."""
    header: dict[str, Any]
    segments: list[Segment]


def pack_state(state: State) -> bytes:
    return marshal.dumps(STATE.pack(state), MARSHAL_VERSION)


def pack_step(now_s: float, inputs: Inputs, decision: Decision) -> bytes:
    return marshal.dumps((now_s, INPUTS.pack(inputs), DECISION.pack(decision)), MARSHAL_VERSION)


def _unpack(packed: bytes) -> Any:  # noqa: ANN401 - any packed value
    return marshal.loads(packed)  # noqa: S302 - our own bytes, which have never left this process


def write(
    order: Order, directory: Path, *, max_files: int, max_bytes: int, pause: Pause = lambda: None
) -> Path:
    """Write a black box atomically under its final name; then delete the files beyond `max_files`.

    `pause` is called after each line, so that the interpreter is held for one line at a time.

    Raises:
        OSError: the file cannot be written, or other users can change the directory; no partial file remains.
    """

    def lines(segment: Segment) -> Iterable[str]:
        yield dumps({"state": STATE.spell(_unpack(segment[0]))})
        for step in segment[1]:
            pause()
            now_s, inputs, decision = _unpack(step)
            yield dumps(
                {"now_s": now_s, "inputs": INPUTS.spell(inputs), "decision": DECISION.spell(decision)}
            )
        pause()

    members = [_member(lines(segment)) for segment in order.segments]
    first = len(members) - 1
    size = len(members[first])
    while first > 0 and size + len(members[first - 1]) <= max_bytes:
        first -= 1
        size += len(members[first])
    steps = sum(len(segment[1]) for segment in order.segments)
    kept = sum(len(segment[1]) for segment in order.segments[first:])
    header = {
        "format": FORMAT,
        "version": VERSION,
        **order.header,
        "steps": kept,
        "first_s": _unpack(next(iter(order.segments[first][1])))[0],
        "left_out_for_file_size": steps - kept,
    }
    end = {"end": True, "steps": kept}
    make_directory(directory, 0o755)
    refused = refusal(directory)
    if refused is not None:
        raise PermissionError(refused)
    _delete_abandoned(directory)
    path = _store(directory, order.name, [_member([dumps(header)]), *members[first:], _member([dumps(end)])])
    _delete_least_worth(directory, path, max_files)
    return path


def dumps(document: Any) -> str:  # noqa: ANN401 - any JSON
    """Return one line of a black box, without the newline."""
    return json.dumps(document, allow_nan=False, separators=(",", ":"))


def _member(lines: Iterable[str]) -> bytes:
    return gzip.compress("".join(f"{line}\n" for line in lines).encode(), COMPRESSION, mtime=0)


def _store(directory: Path, name: str, members: Iterable[bytes]) -> Path:
    path = directory / f"{name}{SUFFIX}"
    count = 1
    while os.path.lexists(path):
        count += 1
        path = directory / f"{name}-{count}{SUFFIX}"
    temporary = directory / f".{path.name}.{os.getpid()}.tmp"
    try:
        with open(temporary, "xb", opener=open_own) as file:
            file.writelines(members)
            file.flush()
            os.fsync(file.fileno())
        temporary.rename(path)
    except BaseException:
        with suppress(OSError):
            temporary.unlink()
        raise
    return path


def _delete_abandoned(directory: Path) -> None:
    """Delete the temporary files of killed supervisors."""
    for temporary in directory.glob(f".*{SUFFIX}.*.tmp"):
        pid = temporary.name.split(".")[-2]
        if pid.isdecimal() and not _runs(int(pid)):
            with suppress(OSError):
                temporary.unlink()


def _runs(pid: int) -> bool:
    """Return whether another process with this id runs; this process writes one file at a time."""
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        return True
    return pid != os.getpid()


def _delete_least_worth(directory: Path, newest: Path, max_files: int) -> None:
    """Delete files of routine stops first, and never the newest file, even if the wall clock was set back.

    A new file of a routine stop never displaces a file of another stop: then `max_files` + 1 files are kept.
    """
    others = [
        (name["reason"] not in ROUTINE, path)
        for path in directory.iterdir()
        if path != newest and (name := OURS.fullmatch(path.name))
    ]
    own = OURS.fullmatch(newest.name)
    is_routine = own is not None and own["reason"] in ROUTINE
    for is_incident, path in sorted(others)[: max(0, len(others) + 1 - max_files)]:
        if is_incident and is_routine:
            break
        with suppress(OSError):
            path.unlink()
