"""Two network namespaces, each with a TUN device: a program in one reaches the other only through the router (root).

The names contain the pid of the process that made them. They are removed at the end of the context, also after SIGINT and
SIGTERM if these raise. What a killed process has left is removed when the next pair is made.
"""

import ctypes
import fcntl
import os
import re
import struct
from collections.abc import Generator, Iterable
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from deploy.stack.errors import DeployError
from faults.real.rig.cable import ip, missing

DEVICE = "lossy"
TUN = Path("/dev/net/tun")
NAMED = Path("/var/run/netns")
MTU = 1400
_NAME = re.compile(r"lifeline-link-(\d+)-[ab]")
_SET_INTERFACE, _IS_TUN, _NO_PACKET_INFO, _NEW_NET = 0x400454CA, 0x0001, 0x1000, 0x40000000


@dataclass(frozen=True)
class Pair:
    """The namespaces of the commands' sender (`a`) and of their receiver (`b`)."""

    a: str
    b: str
    a_fd: int
    """The file descriptor of the TUN device in `a`: what is read was sent in `a`, and what is written arrives there."""
    b_fd: int

    @staticmethod
    def a_address(number: int) -> str:
        """Return the address of side `a` on a path."""
        return f"10.98.{number}.1"

    @staticmethod
    def b_address(number: int) -> str:
        """Return the address of side `b` on a path."""
        return f"10.98.{number}.2"


def inside(name: str) -> tuple[str, ...]:
    """Return the prefix that runs a command in a namespace, with its own process id."""
    return ("ip", "netns", "exec", name)


def why_not() -> str | None:
    """Return why no namespace can be made here, in one sentence; None if it can."""
    return missing() or (None if TUN.exists() else f"this machine has no {TUN}")


@contextmanager
def pair(numbers: Iterable[int]) -> Generator[Pair]:
    """Make the namespaces with addresses for these paths; remove them at the end.

    Args:
        numbers: the paths, 1 to 254.

    Raises:
        DeployError: this machine or the kernel refuses.
    """
    reason = why_not()
    if reason is not None:
        raise DeployError(reason)
    remove_leftovers()
    paths = list(numbers)
    a, b = (f"lifeline-link-{os.getpid()}-{side}" for side in "ab")
    opened: list[int] = []
    try:
        for name in (a, b):
            ip("netns", "add", name)
            opened.append(_open_tun(name))
        for name, own, peer in ((a, Pair.a_address, Pair.b_address), (b, Pair.b_address, Pair.a_address)):
            lines = [f"addr add {own(number)} peer {peer(number)} dev {DEVICE}" for number in paths]
            lines += [f"link set {DEVICE} mtu {MTU} up", "link set lo up"]
            ip("-n", name, "-batch", "-", typed="\n".join(lines) + "\n")
        yield Pair(a, b, *opened)
    finally:
        for fd in opened:
            os.close(fd)
        for name in (a, b):
            _remove(name)


def remove_leftovers() -> None:
    """Remove the namespaces of processes that do not exist any more."""
    if not NAMED.is_dir():
        return
    for name in sorted(path.name for path in NAMED.iterdir()):
        found = _NAME.fullmatch(name)
        if found is not None and not Path(f"/proc/{found[1]}").exists():
            _remove(name)


def _remove(name: str) -> None:
    if (NAMED / name).exists():
        with suppress(DeployError):
            ip("netns", "del", name)


def _open_tun(name: str) -> int:
    """Make a TUN device in a namespace; its file descriptor can be used from outside."""
    with entered(NAMED / name):
        try:
            fd = os.open(TUN, os.O_RDWR | os.O_NONBLOCK)
            fcntl.ioctl(fd, _SET_INTERFACE, struct.pack("16sH", DEVICE.encode(), _IS_TUN | _NO_PACKET_INFO))
        except OSError as error:
            raise DeployError(f"cannot make a TUN device: {error.strerror}") from error
    return fd


@contextmanager
def entered(namespace: Path) -> Generator[None]:
    """Open sockets and devices in another network namespace: they stay in it, and the thread returns.

    Raises:
        DeployError: the kernel refuses.
    """
    with Path("/proc/thread-self/ns/net").open() as home, namespace.open() as there:
        _enter(there.fileno())
        try:
            yield
        finally:
            _enter(home.fileno())


def _enter(namespace_fd: int) -> None:
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.setns(namespace_fd, _NEW_NET) != 0:
        raise DeployError(f"cannot enter a network namespace: {os.strerror(ctypes.get_errno())}")
