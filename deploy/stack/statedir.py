"""The state directory: the files of a running stack, and a lock that excludes other commands."""

import fcntl
import json
import os
import shlex
from collections.abc import Generator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

from deploy.stack.errors import DeployError
from wire.foreign import MAX_BYTES, ForeignError, from_json, open_file, read_text
from wire.host.config import ConfigError, absolute
from wire.host.installation import ENVIRONMENT, state_directory
from wire.ownership import make_directory, open_lock, refusal

MAX_PID = 1 << 22
SOCKET_PATH_LIMIT = 99
"""Bytes. The kernel permits 107; supervisord first binds to the path with a dot and its pid appended."""


@dataclass(frozen=True, slots=True)
class StateDir:
    """The paths in one state directory, as absolute paths."""

    path: Path
    """Without links, so that it names the same processes however it was given."""
    given: Path | None = field(default=None, compare=False)
    """As it was given: another user may be able to exchange a link on it."""

    @classmethod
    def choose(cls, given: Path | None) -> "StateDir":
        """Return the given directory, else the default of `wire/host/installation.py`.

        Raises:
            DeployError: the path begins with `~NAME` and there is no such user.
        """
        try:
            chosen = absolute(given) if given else state_directory()
        except ConfigError as error:
            raise DeployError(f"{error}, with --state-dir or {ENVIRONMENT}") from error
        return cls(Path(os.path.realpath(chosen)), chosen)

    @property
    def option(self) -> str:
        """The option that names it to another command, with a space before it; empty for the default."""
        return "" if self == self.choose(None) else f" --state-dir {shlex.quote(str(self.path))}"

    @property
    def socket(self) -> Path:
        return self.path / "supervisord.sock"

    @property
    def pid_file(self) -> Path:
        return self.path / "supervisord.pid"

    @property
    def record(self) -> Path:
        return self.path / "stack.json"

    @property
    def lock(self) -> Path:
        return self.path / "lock"

    def log(self, program: str) -> Path:
        return self.path / f"{program}.log"

    def create(self) -> None:
        """Create the directory, accessible to this user only.

        Raises:
            DeployError: it cannot be created, other users can change it, or its path is too long for a socket.
        """
        length = len(os.fsencode(self.socket))
        if length > SOCKET_PATH_LIMIT:
            raise DeployError(
                f"the path of the state directory {self.path} is too long for a socket ({length} bytes, at most "
                f"{SOCKET_PATH_LIMIT}): choose a shorter one with --state-dir or {ENVIRONMENT}"
            )
        try:
            make_directory(self.path)
            refused = refusal(self.given or self.path)
        except OSError as error:
            raise DeployError(
                f"cannot create the state directory {self.path} ({error.strerror}): "
                f"choose another with --state-dir or {ENVIRONMENT}"
            ) from error
        if refused is not None:
            raise DeployError(refused)

    def forget(self) -> None:
        """Remove the socket, pid file and record of a running stack, and keep the logs; a pipe in the place of a log would block.

        Raises:
            UnwritableError: a file cannot be removed.
        """
        try:
            for path in (self.socket, self.pid_file, self.record):
                path.unlink(missing_ok=True)
            if self.log("supervisord").is_fifo():
                self.log("supervisord").unlink()
        except OSError as error:
            raise UnwritableError(self, error) from error

    def last_lines(self, program: str) -> str:
        """Return the end of a program's log, indented; empty if there is no log."""
        return indented(self.end_of_log(program))

    def end_of_log(self, program: str) -> str:
        """Return the end of a program's log, at most `MAX_BYTES`; empty if there is no log."""
        try:
            with open_file(self.log(program)) as file:
                file.seek(-min(MAX_BYTES, file.seek(0, os.SEEK_END)), os.SEEK_END)
                return file.read(MAX_BYTES).decode(errors="replace")
        except OSError:
            return ""


def indented(text: str) -> str:
    """Return the last lines of a text, indented."""
    return "\n".join(f"    {line}" for line in text.splitlines()[-8:])


class UnwritableError(DeployError):
    """The directory is not writable, or its disk is full."""

    def __init__(self, state: StateDir, error: OSError) -> None:
        super().__init__(
            f"cannot write in the state directory {state.path} ({error.strerror}): "
            f"choose another with --state-dir or {ENVIRONMENT}"
        )


class LockedError(DeployError):
    """Another command holds the lock of this state directory."""

    def __init__(self, state: StateDir) -> None:
        record = read_json(state.lock)
        pid: object = record.get("pid")
        # Other numbers stand for several processes, or for none.
        self.pid = pid if type(pid) is int and 0 < pid <= MAX_PID else None
        self.command: object = record.get("command")
        who = f"`lifeline {self.command}` (pid {self.pid})" if self.pid else "another `lifeline`"
        super().__init__(
            f"{who} is using {state.path}: wait until it ends, stop it with `lifeline down`, "
            "or choose another directory with --state-dir"
        )


@contextmanager
def locked(state: StateDir, command: str) -> Generator[None]:
    """Lock the state directory against other commands; the kernel releases the lock if this process dies.

    Raises:
        LockedError: another command holds it.
        UnwritableError: the lock file cannot be opened.
    """
    try:
        lock = os.fdopen(open_lock(state.lock), "a+b", buffering=0)
    except OSError as error:
        raise UnwritableError(state, error) from error
    with lock as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise LockedError(state) from error
        with suppress(OSError):  # on a full disk the lock still holds
            file.truncate(0)
            file.write(json.dumps({"pid": os.getpid(), "command": command}).encode())
        try:
            yield
        finally:
            with suppress(OSError):
                file.truncate(0)


def read_json(path: Path) -> dict[str, Any]:
    """Read a JSON object from a file; return an empty one if there is none."""
    try:
        document: object = from_json(read_text(path))
    except (OSError, ForeignError):
        return {}
    return cast("dict[str, Any]", document) if isinstance(document, dict) else {}
