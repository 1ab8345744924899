"""What motion has shown of the robot, kept across restarts of the supervisor: brakes and dead time, and the mounting of the lidars.

`BaseFile` stores this in the state directory, beside the e-stop record:

    base-robot.json   of the namespace `robot`, with a hash of the law's configuration

A file that is damaged, or of another configuration, is ignored with one sentence: nothing then counts as measured.
`BaseRecord` reads and writes it on a thread of its own, so that no call waits for the disk after the start. A file that cannot
be written is a warning and no stop: the present supervisor still knows the results.
"""

import hashlib
import json
import logging
import math
import os
import queue
import threading
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple, cast

from supervisor.law.base_braking import (
    GREATEST_M_S2,
    KEPT,
    LEAST_M_S2,
    LONGEST_DEAD_S,
    UNMEASURED,
    Braking,
)
from supervisor.law.model import LawConfig
from wire.foreign import open_file
from wire.ownership import make_directory, open_own, refusal, synchronise
from wire.text import printable

_log = logging.getLogger(__name__)

FORMAT = 1
MAX_BYTES = 4096
"""More than twenty numbers and a hash take."""
READ_LIMIT_S = 1.0
CLOSE_LIMIT_S = 0.5


class Shown(NamedTuple):
    """What motion has shown of a robot."""

    braking: Braking = UNMEASURED
    """What the base has shown at its stops."""
    mounts_confirmed: bool = False
    """Whether the scans of every lidar have agreed with a translation and a rotation."""


def hash_of(law: LawConfig) -> str:
    """Return a hash of the configuration of the law, without what the law has measured."""
    configured = replace(law, shown_m_s2=math.inf, shown_dead_s=0.0)
    return hashlib.sha256(repr(configured).encode()).hexdigest()


class BaseFile:
    """What motion has shown of one robot, in one directory. All calls may block on the disk.

    Args:
        directory: created if it is missing.
        namespace: the robot's namespace; each has its own file.
        law: the configuration of the law.
    """

    def __init__(self, directory: Path, namespace: str, law: LawConfig) -> None:
        self._directory = directory
        self.path = directory / f"base-{namespace}.json"
        self._law = hash_of(law)

    def read(self) -> Shown:
        """Return what was shown before; nothing if there is no file.

        Raises:
            OSError: the file cannot be read.
            ValueError: it is not trusted, damaged, or of another configuration; the message says which.
        """
        try:
            with open_file(self.path, open_own) as file:
                content = file.read(MAX_BYTES + 1)
        except FileNotFoundError:
            return Shown()
        refused = refusal(self._directory) or refusal(self.path)
        if refused is not None:
            raise ValueError(refused)
        return self._parse(content)

    def write(self, shown: Shown) -> None:
        """Replace the file atomically and durably.

        Raises:
            OSError: it cannot be written.
            ValueError: other users can change the directory.
        """
        make_directory(self._directory)
        refused = refusal(self._directory)
        if refused is not None:
            raise ValueError(refused)
        document = {
            "format": FORMAT,
            "law": self._law,
            "braking_m_s2": shown.braking.shown_m_s2,
            "dead_time_s": shown.braking.shown_dead_s,
            "mounts_confirmed": shown.mounts_confirmed,
        }
        new = self.path.with_suffix(".new")
        new.unlink(missing_ok=True)  # what has its name may be a link, or a pipe that blocks
        with open(new, "xb", opener=_open_private) as file:
            file.write(json.dumps(document).encode())
            file.flush()
            os.fsync(file.fileno())
        new.replace(self.path)
        synchronise(self._directory)

    def _parse(self, content: bytes) -> Shown:
        if len(content) > MAX_BYTES:
            raise ValueError("it is too long")
        try:
            document = json.loads(content)
        except (ValueError, RecursionError):
            raise ValueError("it is damaged") from None
        values = cast("dict[str, Any]", document) if isinstance(document, dict) else {}
        if values.get("format") != FORMAT:
            raise ValueError("it has another format")
        if values.get("law") != self._law:
            raise ValueError("it was measured with another configuration")
        braking = UNMEASURED._replace(
            shown_m_s2=_numbers(values.get("braking_m_s2"), LEAST_M_S2, GREATEST_M_S2),
            shown_dead_s=_numbers(values.get("dead_time_s"), 0.0, LONGEST_DEAD_S),
        )
        return Shown(braking, values.get("mounts_confirmed") is True)


def _open_private(path: str, flags: int) -> int:
    return open_own(path, flags, 0o600)


def _numbers(value: object, least: float, most: float) -> tuple[float, ...]:
    """Return a list of results.

    Raises:
        ValueError: it is no such list.
    """
    numbers = cast("list[object]", value) if isinstance(value, list) else [None]
    good = [one for one in numbers if isinstance(one, float) and least <= one <= most]
    if len(good) < len(numbers) or len(good) > KEPT:
        raise ValueError("it is damaged")
    return tuple(good)


def _results(shown: Shown) -> tuple[object, ...]:
    """Return what is kept in the file."""
    return shown.braking.shown_m_s2, shown.braking.shown_dead_s, shown.mounts_confirmed


class BaseRecord:
    """What motion has shown, on a disk: read at the start, and written by a thread whenever it has shown more."""

    def __init__(self, file: BaseFile, *, read_limit_s: float = READ_LIMIT_S) -> None:
        """Read the results.

        Args:
            file: the storage of the results.
            read_limit_s: the maximum time for this; after it, nothing counts as measured.
        """
        self._file = file
        # Its `put` never blocks: it takes no lock that a descheduled thread could hold.
        self._orders: queue.SimpleQueue[Shown | None] = queue.SimpleQueue()
        self._found = Shown()
        self._was_read, self._ended = threading.Event(), threading.Event()
        threading.Thread(target=self._run, name="base record", daemon=True).start()
        if not self._was_read.wait(read_limit_s):
            _log.warning("%s was not read within %g s: nothing counts as measured", file.path, read_limit_s)
        self.at_start = self._kept = self._found
        """What was shown before this start."""

    def keep(self, shown: Shown) -> None:
        """Have new results written. It never blocks, and does nothing unless there is one."""
        if _results(shown) != _results(self._kept):
            self._kept = shown
            self._orders.put(shown)

    def close(self) -> None:
        """Let the thread write the newest results."""
        self._orders.put(None)
        self._ended.wait(CLOSE_LIMIT_S)

    # --- called on the thread

    def _run(self) -> None:
        try:
            self._found = self._file.read()
        except Exception as error:  # noqa: BLE001 - after any error, nothing is known of the base
            said = printable(str(error))
            _log.warning("%s is ignored, so nothing counts as measured: %s", self._file.path, said)
        self._was_read.set()
        problem = ""
        while (shown := self._orders.get()) is not None:
            before, problem = problem, self._write(shown)
            if problem and problem != before:
                _log.warning("what motion has shown is lost at the next start: %s", printable(problem))
        self._ended.set()

    def _write(self, shown: Shown) -> str:
        """Write, and return why this failed; empty if it did not."""
        try:
            self._file.write(shown)
        except Exception as error:  # noqa: BLE001 - supervision continues
            return str(error) or type(error).__name__
        return ""
