"""Which user has the other end of a connection, from the real kernel; the system tests have another user."""

import os
import resource
import socket
from pathlib import Path

import pytest

from wire.host import connections
from wire.host.connections import ROOT, is_here, tcp_user, unix_users

STRANGER = 65533
needs_root = pytest.mark.skipif(os.getuid() != ROOT, reason="needs root, to become another user")


def address(one: tuple[str, int]) -> str:
    host, port = one[:2]
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


def user_of(client: socket.socket) -> int | None:
    return tcp_user(address(client.getsockname()), address(client.getpeername()))


@pytest.mark.parametrize(
    ("listen", "connect", "family"),
    [
        ("127.0.0.1", "127.0.0.1", socket.AF_INET),
        ("::1", "::1", socket.AF_INET6),
        ("::", "127.0.0.1", socket.AF_INET6),
    ],
    ids=["IPv4", "IPv6", "IPv4 at a listener of both"],
)
def test_the_other_end_of_a_connection_belongs_to_the_user_who_accepted_it(
    listen: str, connect: str, family: socket.AddressFamily
) -> None:
    with socket.create_server((listen, 0), family=family, dualstack_ipv6=listen == "::") as server:
        port = server.getsockname()[1]
        with socket.create_connection((connect, port)) as client, server.accept()[0]:
            assert user_of(client) == os.getuid()


def test_a_connection_that_nobody_has_accepted_proves_nothing_although_the_kernel_shows_it_as_roots() -> None:
    with (
        socket.create_server(("127.0.0.1", 0)) as server,
        socket.create_connection(server.getsockname()) as client,
    ):
        assert user_of(client) is None
        with server.accept()[0]:
            assert user_of(client) == os.getuid()


def test_a_connection_that_the_other_side_has_closed_proves_nothing() -> None:
    with (
        socket.create_server(("127.0.0.1", 0)) as server,
        socket.create_connection(server.getsockname()) as client,
    ):
        server.accept()[0].close()
        assert user_of(client) is None


@needs_root
def test_what_root_accepts_for_the_listener_of_another_user_is_not_roots() -> None:
    """So it looks if the kernel accepts for that user's AF_SMC socket."""
    os.seteuid(STRANGER)
    try:
        server = socket.create_server(("127.0.0.1", 0))
    finally:
        os.seteuid(ROOT)
    with server, socket.create_connection(server.getsockname()) as client, server.accept()[0]:
        assert user_of(client) == STRANGER
        server.close()
        assert user_of(client) is None


@needs_root
@pytest.mark.parametrize("listen", ["127.0.0.1", "0.0.0.0", "::"])
def test_root_is_believed_where_it_listens(listen: str) -> None:
    family = socket.AF_INET6 if ":" in listen else socket.AF_INET
    with socket.create_server((listen, 0), family=family, dualstack_ipv6=":" in listen) as server:
        port = server.getsockname()[1]
        with socket.create_connection(("127.0.0.1", port)) as client, server.accept()[0]:
            assert user_of(client) == ROOT


def test_a_listener_without_the_connection_proves_nothing() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        assert tcp_user("127.0.0.1:1", address(server.getsockname())) is None


def test_without_proc_nothing_is_proven(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(connections, "UID_MAP", tmp_path / "missing")
    with (
        socket.create_server(("127.0.0.1", 0)) as server,
        socket.create_connection(server.getsockname()) as client,
        server.accept()[0],
    ):
        assert user_of(client) is None


@pytest.mark.parametrize(("maps", "known"), [("0 0 4294967295\n", True), ("0 100000 65536\n", False)])
def test_a_user_whom_this_user_namespace_does_not_know_proves_nothing(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, maps: str, *, known: bool
) -> None:
    (tmp_path / "uid_map").write_text(maps)
    monkeypatch.setattr(connections, "UID_MAP", tmp_path / "uid_map")
    monkeypatch.setattr(connections, "STAND_IN", os.getuid())
    with (
        socket.create_server(("127.0.0.1", 0)) as server,
        socket.create_connection(server.getsockname()) as client,
        server.accept()[0],
    ):
        assert user_of(client) == (os.getuid() if known else None)


def test_a_unix_socket_belongs_to_the_user_who_listens_there(tmp_path: Path) -> None:
    path, other = str(tmp_path / "s"), str(tmp_path / "other")
    with socket.socket(socket.AF_UNIX) as server, socket.socket(socket.AF_UNIX) as client:
        server.bind(path)
        server.listen()
        assert unix_users(path) == []
        client.connect(path)
        assert unix_users(path) == [os.getuid()]
        assert unix_users(other) == []
        client.sendall(b"it is still open")


def test_a_unix_socket_is_also_found_through_another_path_than_the_one_of_its_listener(
    tmp_path: Path,
) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to("real")
    with socket.socket(socket.AF_UNIX) as server, socket.socket(socket.AF_UNIX) as client:
        server.bind(str(tmp_path / "real" / "s"))
        server.listen()
        client.connect(str(tmp_path / "link" / "s"))
        assert unix_users(str(tmp_path / "link" / "s")) == [os.getuid()]


def test_only_an_address_of_this_machine_is_here() -> None:
    assert is_here("127.0.0.1")
    assert is_here("[::1]")
    assert is_here("localhost")
    assert not is_here("192.0.2.1")
    with pytest.raises(UnicodeError):
        is_here("x" * 64)


def test_without_a_descriptor_to_ask_with_an_address_may_be_here() -> None:
    assert not is_here("192.0.2.1")
    limits = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (3, limits[1]))
    try:
        found = is_here("127.0.0.1")
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, limits)
    assert found
