"""Asks the kernel which user has the other end of a connection of this process, and reads its table of TCP sockets (Linux)."""

import errno
import ipaddress
import socket
import struct
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

ROOT = 0
ESTABLISHED, LISTENING = "01", "0A"
NO_INODE = "0"
"""Of a socket that no process has: nobody has accepted it yet, or its process has closed it. Its user is shown as root."""
EVERY_USER = ["0", "0", "4294967295"]
"""The map of user ids of the machine's own user namespace."""
UID_MAP = Path("/proc/self/uid_map")
STAND_IN = 65534
"""The number that the kernel shows for all users without an entry in this user namespace."""
_CREDENTIALS = struct.Struct("iII")


@dataclass(frozen=True, slots=True)
class TcpSocket:
    """A row of the kernel's tables of TCP sockets, of this process's network namespace."""

    local: str
    """Such as `127.0.0.1:7447` or `[::1]:7447`; an IPv4 address in IPv6 notation is shown as IPv4."""
    remote: str
    state: str
    user: int
    inode: str


def tcp_sockets(ports: tuple[str, str] | None = None) -> Iterator[TcpSocket]:
    """Yield all rows; none where there is no /proc.

    Args:
        ports: only rows with this local and this remote port, in hexadecimal: the addresses of 10,000 rows take 0.1 s to read.
    """
    for table in ("tcp", "tcp6"):
        with suppress(OSError):
            for line in Path(f"/proc/self/net/{table}").read_text().splitlines()[1:]:
                fields = line.split()
                if ports is not None and ports != (fields[1][-4:], fields[2][-4:]):
                    continue
                yield TcpSocket(
                    _address(fields[1]), _address(fields[2]), fields[3], int(fields[7]), fields[9]
                )


def _address(field: str) -> str:
    """Return an address of /proc/net/tcp, such as `0100007F:1D17`, as `127.0.0.1:7447`."""
    host, port = field.split(":")
    words = [int(host[n : n + 8], 16).to_bytes(4, "little") for n in range(0, len(host), 8)]
    address = ipaddress.ip_address(b"".join(words))
    mapped = address.ipv4_mapped if isinstance(address, ipaddress.IPv6Address) else None
    shown = mapped or address
    return f"[{shown}]:{int(port, 16)}" if shown.version == 6 else f"{shown}:{int(port, 16)}"


def tcp_user(local: str, remote: str) -> int | None:
    """Return the user who has the remote end of an established connection; None if the kernel does not show it.

    Args:
        local: the address of this process's end.
        remote: the address of the other end.
    """
    here, there = (f"{int(address.rpartition(':')[2]):04X}" for address in (local, remote))
    for row in tcp_sockets((there, here)):
        if (row.local, row.remote, row.state) == (remote, local, ESTABLISHED) and row.inode != NO_INODE:
            user = min(_listeners(row.local, there), default=None) if row.user == ROOT else row.user
            return None if user is None else _proven(user)
    return None


def _listeners(local: str, port: str) -> list[int]:
    """Return the users whose programs listen where root has accepted a connection.

    A worker of the kernel, which is root, accepts the connections to the AF_SMC socket of any user.
    """
    number = local.rpartition(":")[2]
    places = {local, f"0.0.0.0:{number}", f"[::]:{number}"}
    return [row.user for row in tcp_sockets((port, "0000")) if row.state == LISTENING and row.local in places]


def unix_users(path: str) -> list[int | None]:
    """Return, for each connection of this process to a Unix socket, the user who listened there; None if it is not shown.

    Only the name in the directory is compared: the hub may have made the socket through a link or in another mount namespace.
    """
    name = Path(path).name
    users: list[int | None] = []
    for entry in Path("/proc/self/fd").iterdir():
        with suppress(OSError):
            # The end of a duplicate would release the locks of a file, but does not close a socket.
            if str(entry.readlink()).startswith("socket:"):
                with socket.fromfd(int(entry.name), socket.AF_UNIX, socket.SOCK_STREAM) as one:
                    if Path(str(one.getpeername())).name == name:
                        shown = one.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
                        users.append(_proven(_CREDENTIALS.unpack(shown)[1]))
    return users


def _proven(user: int) -> int | None:
    """Return the user; None if it is the number that stands for all users without an entry in this user namespace."""
    try:
        is_whole = UID_MAP.read_text().split() == EVERY_USER
    except OSError:
        return None
    return user if is_whole or user != STAND_IN else None


def is_here(host: str) -> bool:
    """Return whether a host is this machine, or may be: any error but that of a foreign address proves nothing.

    Raises:
        OSError: the name cannot be resolved.
        UnicodeError: it is not a name.
    """
    family, *_, address = socket.getaddrinfo(host.strip("[]"), 0, type=socket.SOCK_DGRAM)[0]
    try:
        with socket.socket(family, socket.SOCK_DGRAM) as probe:
            probe.bind(address)  # only to an address of this machine
    except OSError as error:
        return error.errno != errno.EADDRNOTAVAIL
    return True
