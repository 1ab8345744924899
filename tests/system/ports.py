"""Endpoints for tests that run at the same time."""

import errno
import socket

from wire.zenoh import local_socket

_ports = iter(range(20_000, 30_000))
"""Ports below the kernel's range for outgoing connections."""
_claims: list[socket.socket] = []


def free_endpoint() -> str:
    """Return a free loopback endpoint that no other test on this machine receives.

    A port is claimed by binding an abstract Unix socket to its number. The claim ends with this process.
    """
    for port in _ports:
        if _claim(port) and _is_free(port):
            return f"tcp/127.0.0.1:{port}"
    raise AssertionError("no free port")


def participants(endpoint: str) -> str:
    """Return where a foreign program of this user takes part; at the endpoint itself, it may only read."""
    there = local_socket.participants(endpoint)
    assert there is not None
    return there


def _claim(port: int) -> bool:
    claim = socket.socket(socket.AF_UNIX)
    try:
        claim.bind(f"\0lifeline-test-port-{port}")
    except OSError as error:
        claim.close()
        if error.errno != errno.EADDRINUSE:
            raise
        return False
    _claims.append(claim)
    return True


def _is_free(port: int) -> bool:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", port))
        except OSError:
            return False
    return True
