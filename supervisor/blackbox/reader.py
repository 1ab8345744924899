"""Reads a black box line by line; `file.py` describes the file.

The memory is bounded by the longest line, so that a damaged file cannot exhaust it, and `wire/foreign.py` bounds the
numbers and the depth of each line. Times are seconds of the recording
supervisor's monotonic clock, unless a name says otherwise.
"""

import gzip
import math
import re
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, TextIO, cast

import numpy as np

from supervisor.blackbox.codec import codec
from supervisor.blackbox.file import FORMAT, INPUTS, LAW, VERSION
from supervisor.law.base import Base
from supervisor.law.decision import Decision
from supervisor.law.interlock import Interlock
from supervisor.law.model import Inputs, LawConfig
from supervisor.law.sight import Sight
from supervisor.law.state import Clock
from wire.foreign import from_json, open_file
from wire.topics import SCAN

LINE_LIMIT = 64 << 20
"""Characters; the state of a law with several lidars of 65,536 beams is shorter."""
FARTHEST_S = 86_400.0
"""A time farther from the stop is damage."""
STEP_BEGINS = '{"now_s":'
UTC = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}")

PARTS = {
    "interlock": Interlock._fields,
    "base": Base._fields,
    "sight": Sight._fields,
    "clock": Clock._fields,
}
NAMES_IN_VERSION_1 = {"lidars": "sights", "writers": "odometry_writers"}

_DECISION, _SECONDS = codec(Decision), codec(float)


class BlackBoxError(Exception):
    """The file cannot be read, or a part of it; the message says why."""


@dataclass(frozen=True, slots=True)
class Document:
    """A whole black box as decoded JSON."""

    header: dict[str, Any]
    lines: Sequence[dict[str, Any]]
    """Its states and steps, in order."""


class Stop(NamedTuple):
    """A stop, as the header describes it."""

    now_s: float
    utc_ns: int
    """Wall time since 1970; the file holds milliseconds."""
    utc: str
    """The same time as text, without a time zone: 2026-07-04T12:00:00.000."""
    reasons: tuple[str, ...]
    """The reasons that were new at this stop, most severe first."""


class Act(NamedTuple):
    """What a person did, as a program reported it: foreign text."""

    utc: str
    by: str
    """The command source whose program reported it, or `e-stop` or `reset`."""
    text: str


class Step(NamedTuple):
    """A step of the law."""

    now_s: float
    inputs: Inputs
    decision: Decision
    """Without its sources, which the file holds once per second only."""


class BlackBoxReader:
    """Reads the header of a black box at once, and its lines on request.

    Raises:
        BlackBoxError: the file cannot be read, is not a black box, has a newer version, or names no stop.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            with open_file(path) as packed, gzip.open(packed, "rt", encoding="utf-8") as file:
                header = _object(_line(file, 1))
        except (OSError, EOFError, ValueError, zlib.error) as error:
            raise BlackBoxError(_no_black_box(path, error)) from error
        version = header.get("version")
        if header.get("format") != FORMAT or not isinstance(version, int):
            raise BlackBoxError(_no_black_box(path, None))
        if version > VERSION:
            raise BlackBoxError(
                f"{path} has version {version}, and this Lifeline reads up to {VERSION}: replay it with a newer Lifeline"
            )
        self._version = version
        self.header = header
        self.stops = stops_of(header)

    @property
    def law(self) -> LawConfig:
        """The configuration of the law that was recorded.

        Raises:
            BlackBoxError: this law does not know it.
        """
        try:
            return cast("LawConfig", LAW.read(self.header["config"]))
        except (KeyError, ValueError) as error:
            raise BlackBoxError(
                f"the configuration in {self.path} does not match this law: {error}"
            ) from error

    @property
    def lidar_topics(self) -> tuple[str, ...]:
        """The topic of each lidar; an older file names only the lidars."""
        named = self.header.get("lidar_topics")
        if isinstance(named, list):
            return tuple(map(str, cast("list[object]", named)))
        others = [f"{SCAN.key}_{lidar.name}" for lidar in self.law.lidars[1:]]
        return (SCAN.key, *others)

    @property
    def acts(self) -> tuple[Act, ...]:
        """What people did before the file was written, in order of time; an older file names nothing.

        Raises:
            BlackBoxError: the file is damaged.
        """
        try:
            return tuple(
                Act(str(one["utc"]), str(one["by"]), str(one["text"]))
                for one in self.header.get("people", [])
            )
        except (KeyError, TypeError) as error:
            raise BlackBoxError(f"the header of {self.path} is damaged: {error!r} in people") from error

    @property
    def left_out(self) -> int:
        """Number of older steps of the window that were left out for lack of space."""
        return left_out_of(self.header)

    def lines(self, from_s: float = -math.inf) -> Iterator[dict[str, Any]]:
        """Yield all states, and the steps from a time on.

        Raises:
            BlackBoxError: the file is damaged or truncated; everything before was yielded.
        """
        number = steps = 0
        try:
            with open_file(self.path) as packed, gzip.open(packed, "rt", encoding="utf-8") as file:
                while text := _line(file, number + 1):
                    number += 1
                    if number == 1:
                        continue
                    if from_s > -math.inf and text.startswith(STEP_BEGINS) and _time_s(text) < from_s:
                        steps += 1
                        continue
                    line = _object(text)
                    if "end" in line:
                        if line == {"end": True, "steps": steps} and not _line(file, number + 1):
                            return
                        break
                    steps += "inputs" in line
                    if "state" in line and self._version == 1:
                        line["state"] = _nested(line["state"])
                    yield line
        except (OSError, EOFError, ValueError, zlib.error) as error:
            raise BlackBoxError(f"{self.path} is damaged after {number} lines: {error}") from error
        raise BlackBoxError(f"{self.path} is truncated: its end is missing")

    def steps(self, from_s: float = -math.inf) -> Iterator[Step]:
        """Yield the steps from a time on, in order.

        Raises:
            BlackBoxError: as above, or a step does not match the types of this law.
        """
        for line in self.lines(from_s):
            if "state" not in line:
                yield self._step(line)

    def _step(self, line: dict[str, Any]) -> Step:
        try:
            now_s = time_of(line, self.stops[0])
            decision = _DECISION.read({**line["decision"], "sources": []})
            return Step(now_s, INPUTS.read(line["inputs"]), decision)
        except (KeyError, TypeError, ValueError) as error:
            raise BlackBoxError(
                f"a step of {self.path} does not match the types of this law: {error}"
            ) from error


def read(path: Path) -> Document:
    """Read a whole black box into memory.

    Raises:
        BlackBoxError: the file cannot be read, is not a black box, has a newer version, is damaged or truncated.
    """
    reader = BlackBoxReader(path)
    return Document(reader.header, list(reader.lines()))


def stops_of(header: dict[str, Any]) -> tuple[Stop, ...]:
    """Return the stops that a header names, at least one.

    Raises:
        BlackBoxError: it names none.
    """
    try:
        first, *others = map(_stop, header["stops"])
    except (KeyError, TypeError, ValueError) as error:
        raise BlackBoxError(f"the header of the black box names no stop: {error}") from error
    return (first, *others)


def left_out_of(header: dict[str, Any]) -> int:
    """Return the number of older steps of the window that were left out for lack of space."""
    counts = (header.get(f"left_out_for_{reason}") for reason in ("memory", "file_size"))
    return sum(count for count in counts if isinstance(count, int))


def time_of(line: dict[str, Any], stop: Stop) -> float:
    """Return the time of a step.

    Raises:
        KeyError, ValueError: it has none, or one that is far from the stop.
    """
    now_s = _SECONDS.read(line["now_s"])
    if not abs(now_s - stop.now_s) <= FARTHEST_S:
        raise ValueError(f"{now_s:g} s is more than a day from the stop")
    return now_s


def _stop(entry: dict[str, Any]) -> Stop:
    utc = str(entry["utc"]).removesuffix("+00:00")
    if UTC.fullmatch(utc) is None:
        raise ValueError(f"{utc!r:.40} is not a time")
    utc_ms = int(np.datetime64(utc, "ms").astype(np.int64))
    now_s = _SECONDS.read(entry["now_s"])
    if not math.isfinite(now_s):
        raise ValueError(f"{now_s} s is not a time")
    return Stop(now_s, utc_ms * 1_000_000, utc, tuple(map(str, entry["reasons"])))


def _line(file: TextIO, number: int) -> str:
    """Return the next line; empty at the end of the file."""
    text = file.readline(LINE_LIMIT)
    if len(text) == LINE_LIMIT:
        raise ValueError(f"line {number} is too long")
    return text


def _time_s(text: str) -> float:
    """Return the time of a step without decoding the rest of its line."""
    return float(text[len(STEP_BEGINS) : text.index(",")])


def _object(line: str) -> dict[str, Any]:
    document: object = from_json(line)
    if not isinstance(document, dict):
        raise ValueError("a line is not a JSON object")  # noqa: TRY004 - a fault of the file
    return cast("dict[str, Any]", document)


def _nested(flat: object) -> dict[str, Any]:
    """Return a state of version 1, which had all fields in one object, as one of version 2."""
    if not isinstance(flat, dict):
        raise ValueError("a state is not a JSON object")  # noqa: TRY004 - a fault of the file
    rest = cast("dict[str, Any]", flat)
    parts: dict[str, Any] = {}
    for part, fields in PARTS.items():
        names = {field: NAMES_IN_VERSION_1.get(field, field) for field in fields}
        parts[part] = {field: rest.pop(name) for field, name in names.items() if name in rest}
    return rest | parts


def _no_black_box(path: Path, error: Exception | None) -> str:
    if isinstance(error, OSError) and error.strerror:
        return f"cannot read {path}: {error.strerror}"
    return f"{path} is not a black box of Lifeline"
