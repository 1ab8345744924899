"""Limits that the kernel enforces on this process."""

import resource
import socket
import struct
import subprocess
import sys
import time

import pytest

from wire.host.process_limits import LINGER_PERIOD_S, clear_linger, never_linger, raise_open_files

FOREVER = struct.pack("ii", 1, 10)
BOUND = """
from wire.host.process_limits import bound_memory
bound_memory(256 << 20)
bound_memory(1 << 40)
kept = [bytes(64 << 20) for _ in range(8)]
"""


def test_a_socket_that_lingers_no_longer_does() -> None:
    with socket.socket() as one, socket.socket(socket.AF_UNIX) as other:
        for each in (one, other):
            each.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, FOREVER)
        clear_linger()
        for each in (one, other):
            assert each.getsockopt(socket.SOL_SOCKET, socket.SO_LINGER, 8)[:4] == b"\0\0\0\0"


def test_sockets_stop_lingering_also_after_a_while_without_free_descriptors() -> None:
    never_linger()
    limits = resource.getrlimit(resource.RLIMIT_NOFILE)
    with socket.socket() as one:
        resource.setrlimit(resource.RLIMIT_NOFILE, (one.fileno(), limits[1]))
        try:
            with pytest.raises(OSError, match="Too many open files"):
                clear_linger()
            time.sleep(2 * LINGER_PERIOD_S)  # the thread meets the same error
        finally:
            resource.setrlimit(resource.RLIMIT_NOFILE, limits)
        one.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, FOREVER)
        until_s = time.monotonic() + 10.0
        while one.getsockopt(socket.SOL_SOCKET, socket.SO_LINGER, 8)[:4] != b"\0\0\0\0":
            assert time.monotonic() < until_s, "the thread has ended"
            time.sleep(LINGER_PERIOD_S)


def test_open_files_are_raised_up_to_the_hard_limit_and_never_lowered(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now = [(1024, 4096)]

    def read(_: int) -> tuple[int, int]:
        return now[-1]

    def change(_: int, both: tuple[int, int]) -> None:
        now.append(both)

    monkeypatch.setattr(resource, "getrlimit", read)
    monkeypatch.setattr(resource, "setrlimit", change)
    assert raise_open_files(500) == 500
    assert now == [(1024, 4096)]
    assert raise_open_files(2000) == 2000
    assert now[-1] == (2000, 4096)
    assert raise_open_files(9000) == 4096
    assert now[-1] == (4096, 4096)
    now.append((1024, resource.RLIM_INFINITY))
    assert raise_open_files(9000) == 9000


def test_memory_beyond_the_limit_cannot_be_allocated() -> None:
    ended = subprocess.run([sys.executable, "-c", BOUND], capture_output=True, text=True, check=False)
    assert ended.returncode == 1
    assert "MemoryError" in ended.stderr
