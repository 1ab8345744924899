"""The process at the other end of a TCP connection, from the real /proc."""

import os
import socket
from pathlib import Path

from lifeline.inspection.sockets import processes_at


def own_command_line() -> list[str]:
    """The kernel's view of this process; pytest-xdist writes the running test's name there."""
    return [part.decode() for part in Path("/proc/self/cmdline").read_bytes().split(b"\0") if part]


def address(one: socket.socket) -> str:
    host, port = one.getsockname()[:2]
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


def test_both_ends_of_a_connection_belong_to_this_process() -> None:
    with (
        socket.create_server(("127.0.0.1", 0)) as server,
        socket.create_connection(server.getsockname()) as client,
    ):
        found = processes_at({address(server), address(client), "127.0.0.1:1"})
        assert {one.pid for one in found.values()} == {os.getpid()}
        assert set(found) == {address(server), address(client)}
        process = found[address(client)]
        assert process.arguments == tuple(own_command_line())
        assert 0.0 <= process.uptime_s < 86400.0


def test_an_address_of_ip_version_6_is_found() -> None:
    with socket.socket(socket.AF_INET6) as server:
        server.bind(("::1", 0))
        server.listen()
        assert processes_at({address(server)})[address(server)].pid == os.getpid()
