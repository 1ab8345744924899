"""Files and directories that other users can change are refused, with the command that repairs them.

Another user who can write to a directory of the robot can remove the record of an e-stop, exchange a key, or put a link in the
place of a file. `refusal` comes before the use of such a directory, and files in it are opened without following links.
"""

import os
import pwd
import shlex
import stat
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

ROOT = 0
CHANGE, ENTER = 0o022, 0o077
"""Permissions that others must not have."""


def refusal(path: Path, forbidden: int = CHANGE) -> str | None:
    """Return why a file or directory is not used, and the command that repairs it; None if other users cannot change it.

    It and the files in it must belong to this user or root, and neither it nor a directory or link above it may be in a directory
    where everyone can exchange it. Who owns a directory above it, or shares its group, is trusted. Root may use what belongs to
    any user.

    Args:
        path: it exists.
        forbidden: the permissions that others must not have.

    Raises:
        OSError: it cannot be looked up.
    """
    real = Path(os.path.realpath(path, strict=True))
    found = real.stat()
    owners = {ROOT, os.geteuid()}
    for part in _open_to_all(path.absolute()):
        if not part.parent.stat().st_mode & stat.S_ISVTX:
            return f"other users can exchange {part}: {_run('chmod +t', part.parent)}"
        if part.lstat().st_uid not in owners:
            return _foreign(part)
    if os.geteuid() == ROOT:
        owners.add(found.st_uid)
    if found.st_uid not in owners:
        return _foreign(real)
    for within in real.iterdir() if stat.S_ISDIR(found.st_mode) else ():
        with suppress(FileNotFoundError):  # it was removed meanwhile
            if within.lstat().st_uid not in owners:
                return _foreign(within)
    if found.st_mode & forbidden:
        mode = stat.S_IMODE(found.st_mode)
        may = "read" if forbidden == ENTER else "change"
        return f"{path} has mode {mode:04o}, so that other users can {may} it: {_run(f'chmod {mode & ~forbidden:o}', real)}"
    return None


def make_directory(path: Path, mode: int = 0o700) -> list[Path]:
    """Make a directory, and those above it so that only this user can change them under any umask; return which were missing."""
    missing = [one for one in (path, *path.parents) if not one.exists()]
    for above in reversed(missing[1:]):
        above.mkdir(mode=0o755, exist_ok=True)
    path.mkdir(mode=mode, exist_ok=True)
    return missing


def synchronise(directory: Path) -> None:
    """Synchronise the entries of a directory to disk, so that they survive a power failure."""
    file = os.open(directory, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(file)
    finally:
        os.close(file)


def open_own(path: str | Path, flags: int, mode: int = 0o666) -> int:
    """Open a file, but no link; also an `opener` of `open`."""
    return os.open(path, flags | os.O_NOFOLLOW | os.O_CLOEXEC, mode)


def open_lock(path: Path) -> int:
    """Open the file of a lock, and make it if it is missing; other users may not read it, since who can open it can hold the lock."""
    file = open_own(path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o600)
    with suppress(PermissionError):  # a file system without permissions
        os.fchmod(file, 0o600)
    return file


def _open_to_all(path: Path) -> Iterator[Path]:
    """Yield the path, the directories above it and those behind each of their links that are in a directory where everyone can write."""
    parts = (path, *path.parents)
    yield from (part for part in parts if part.parent.stat().st_mode & stat.S_IWOTH)
    link = next((part for part in reversed(parts) if part.is_symlink()), None)
    if link is not None:
        yield from _open_to_all(link.parent / link.readlink() / path.relative_to(link))


def _foreign(path: Path) -> str:
    found = path.lstat()
    repair = _run("rm", path) if stat.S_ISLNK(found.st_mode) else _run(f"chown {_name(os.geteuid())}", path)
    return f"{path} belongs to the user {_name(found.st_uid)}: {repair}"


def _name(user: int) -> str:
    try:
        return pwd.getpwuid(user).pw_name
    except KeyError:
        return str(user)


def _run(command: str, path: Path) -> str:
    sudo = "" if os.geteuid() in {ROOT, path.lstat().st_uid} else "sudo "
    return f"run `{sudo}{command} {shlex.quote(str(path))}`"
