"""The socket through which the programs of the supervisor's user take part, beside its TCP endpoint.

Zenoh cannot identify who opens a TCP connection, so a program that connects to `tcp/` only reads. The hub therefore also
listens on a Unix socket in a directory that only its user may enter. Our programs of that user find it by the port of
the endpoint, and need no option. Zenoh keeps a lock beside the socket, so that a restarted hub replaces that of a killed one;
the next hub to start removes the files of the others whose process is gone.
"""

import fcntl
import os
import pwd
import re
import secrets
import socket
from contextlib import suppress
from pathlib import Path

from wire.ownership import ENTER, make_directory, open_own, refusal

ENVIRONMENT = "LIFELINE_RUN_DIR"
UNDER_HOME = Path(".local/state/lifeline/run")
PROTOCOL = "unixsock-stream"
MAX_PATH_BYTES = 107
"""Of `sockaddr_un`, without the byte at its end."""
LOCK = ".lock"
_LOCKS = re.compile(r"(\d+-)?\d+\.sock\.lock")
ANSWER_S = 1.0
_RANDOM_BITS = 96
_IN_ENDPOINTS = frozenset("?#")
"""Characters after which Zenoh reads options. It would cut the path there, and create the socket in a directory that others may enter."""


class SocketError(Exception):
    """The hub cannot offer its socket; the message says why, and what to do."""


def run_directory() -> Path:
    """Return the directory of the sockets: `$LIFELINE_RUN_DIR`, else one in the user's home.

    The home is that of the user database: two programs of one user must find the same directory, also if one of them was
    started by a service manager or with sudo.
    """
    named = os.environ.get(ENVIRONMENT)
    if named:
        return Path(named).absolute()
    try:
        home = Path(pwd.getpwuid(os.getuid()).pw_dir)
    except KeyError:  # a user id without an entry, as in some containers
        home = Path(os.environ.get("HOME", "/"))
    return home / UNDER_HOME


def socket_of(endpoint: str) -> Path | None:
    """Return the path of the socket that belongs to an endpoint of the hub; None with certificates.

    The name has the port and the network namespace, since the port is unique only within it.
    """
    if not endpoint.startswith("tcp/"):
        return None
    try:
        network = f"{Path('/proc/self/ns/net').stat().st_ino}-"
    except OSError:  # not Linux
        network = ""
    return run_directory() / f"{network}{endpoint.rpartition(':')[2]}.sock"


def zenoh_endpoint(path: Path) -> str:
    """Return a socket's path as a Zenoh endpoint."""
    return f"{PROTOCOL}/{path}"


def participants(endpoint: str) -> str | None:
    """Return the Zenoh endpoint for foreign programs of the hub's user; None with certificates."""
    path = socket_of(endpoint)
    return None if path is None else zenoh_endpoint(path)


def prepare(path: Path) -> None:
    """Make the directory of a socket, for its user only, and remove what ended hubs left in it.

    Raises:
        SocketError: it cannot be made, other users may enter it, or Zenoh cannot use its path.
    """
    directory = path.parent
    remedy = f"name another directory of this user with {ENVIRONMENT}"
    if len(os.fsencode(path)) > MAX_PATH_BYTES:
        raise SocketError(f"the path of the socket {path} is longer than {MAX_PATH_BYTES} bytes: {remedy}")
    if not _IN_ENDPOINTS.isdisjoint(str(path)) or str(path).encode(errors="ignore") != os.fsencode(path):
        raise SocketError(
            f"Zenoh cannot use the path of the socket {path}: it has ? or #, or is not UTF-8: {remedy}"
        )
    try:
        make_directory(directory)
        refused = refusal(directory, ENTER)
    except OSError as error:
        raise SocketError(f"cannot make {directory} ({error.strerror}): {remedy}") from error
    if refused is not None:
        raise SocketError(f"{refused}, or {remedy}")
    for left in directory.iterdir():
        with suppress(OSError):  # BlockingIOError: its hub runs
            if left.name != path.name + LOCK and _LOCKS.fullmatch(left.name):
                _remove(left)


def _remove(lock: Path) -> None:
    """Remove a lock and its socket if no hub holds the lock.

    Raises:
        BlockingIOError: a hub holds it.
    """
    file = open_own(lock, os.O_RDONLY | os.O_NONBLOCK)
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        lock.with_name(lock.name.removesuffix(LOCK)).unlink(missing_ok=True)
        lock.unlink(missing_ok=True)
    finally:
        os.close(file)


def identity(path: Path) -> tuple[int, int] | None:
    """Return the device and inode at the path of a socket; None if nothing can be seen there."""
    try:
        found = path.lstat()
    except OSError:
        return None
    return found.st_dev, found.st_ino


def answers(path: Path) -> bool:
    """Return whether a hub listens on a socket; blocks for at most a second."""
    with socket.socket(socket.AF_UNIX) as probe:
        probe.settimeout(ANSWER_S)
        try:
            probe.connect(str(path))
        except OSError:
            return False
    return True


def session_id(pid: int) -> str:
    """Return a new random id for a session at a socket, which ends with the pid of its process.

    The hub knows no address of such a session, so this is how `lifeline node` finds its process.
    """
    return f"{secrets.randbits(_RANDOM_BITS) | 1 << _RANDOM_BITS - 1:024x}{pid:08x}"


def pid_in(session: str) -> int:
    """Return the pid that the id of a session at a socket ends with; meaningless for an id that Zenoh made."""
    return int(session[-8:], 16)
