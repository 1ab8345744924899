"""The guard of a publisher's process, with real processes that are killed and stopped."""

import asyncio
import os
from pathlib import Path

import pytest

from ros2 import guard
from ros2.guard import Guard, dds_processes, inner_pid, is_stopped, pid_of
from tests.unit.ros2.processes import LIMIT_S, OWN_GID, Child, gid_of, go_on, stop


class Deaths:
    """Collects the identities that a guard reports."""

    def __init__(self) -> None:
        self.gids: list[bytes] = []
        self._changed = asyncio.Event()

    def __call__(self, gid: bytes) -> None:
        self.gids.append(gid)
        self._changed.set()

    async def one(self) -> list[bytes]:
        async with asyncio.timeout(LIMIT_S):
            await self._changed.wait()
        self._changed.clear()
        return self.gids


# --- the process of an identity


def test_the_process_of_an_endpoint_is_the_only_candidate() -> None:
    assert pid_of(gid_of(0x1_2345), OWN_GID, [0x1_2345]) == 0x1_2345
    assert pid_of(gid_of(0x1_2345), OWN_GID, []) is None


@pytest.mark.parametrize(
    ("status", "inner"),
    [
        (b"Name:\tx\nNSpid:\t4711\nNSsid:\t1\n", 4711),
        (b"NSpid:\t4711\t12\n", 12),
        (b"Name:\tx\n", 4711),
    ],
    ids=["host", "container", "old kernel"],
)
def test_the_inner_id_is_that_of_the_innermost_namespace(tmp_path: Path, status: bytes, inner: int) -> None:
    entry = tmp_path / "4711"
    entry.mkdir()
    assert inner_pid(entry) == 0
    (entry / "status").write_bytes(status)
    assert inner_pid(entry) == inner


def test_of_two_candidates_none_is_watched() -> None:
    assert pid_of(gid_of(0x2345), OWN_GID, [0x2345, 0x1_2345]) is None


@pytest.mark.parametrize(
    ("gid", "own_gid"),
    [
        (gid_of(77, host=b"\x12\x35"), OWN_GID),
        (b"\x01\x10" + gid_of(77)[2:], OWN_GID),
        (gid_of(77), b""),
        (gid_of(77), b"\x01\x10" + OWN_GID[2:]),
        (b"", OWN_GID),
        (b"", b""),
    ],
    ids=[
        "another host",
        "another vendor",
        "unknown self",
        "another own vendor",
        "no identity",
        "nothing known",
    ],
)
def test_a_publisher_of_another_host_or_vendor_has_no_process_here(gid: bytes, own_gid: bytes) -> None:
    assert pid_of(gid, own_gid, [77]) is None


def test_processes_are_not_searched_for_a_publisher_of_another_host() -> None:
    candidates = iter([77])
    assert pid_of(gid_of(77, host=b"\x12\x35"), OWN_GID, candidates) is None
    assert next(candidates) == 77


def test_only_processes_that_have_loaded_dds_are_candidates(
    child: Child, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert child.pid in dds_processes(child.pid & 0xFFFF)
    assert child.pid not in dds_processes((child.pid + 1) & 0xFFFF)
    monkeypatch.setattr(guard, "DDS_LIBRARIES", (b"libfastdds",))
    assert child.pid not in dds_processes(child.pid & 0xFFFF)


def test_a_process_that_has_ended_is_no_candidate_although_nobody_has_reaped_it(
    child: Child,
) -> None:
    child.kill()
    os.waitid(os.P_PID, child.pid, os.WEXITED | os.WNOWAIT)
    assert Path(f"/proc/{child.pid}").exists()
    assert child.pid not in dds_processes(child.pid & 0xFFFF)


@pytest.mark.parametrize(("error", "is_included"), [(PermissionError, True), (ProcessLookupError, False)])
def test_another_users_process_is_a_candidate_and_an_ended_one_is_not(
    error: type[OSError], *, is_included: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    read = Path.read_bytes

    def refuse(path: Path) -> bytes:
        if path.name == "maps":
            raise error
        return read(path)

    monkeypatch.setattr(Path, "read_bytes", refuse)
    assert (os.getpid() in dds_processes(os.getpid() & 0xFFFF)) is is_included


# --- stopped processes


def test_a_process_is_stopped_from_sigstop_to_sigcont(child: Child) -> None:
    assert not is_stopped(child.pid)
    stop(child)
    assert is_stopped(child.pid)
    go_on(child)
    assert not is_stopped(child.pid)


def test_a_process_that_does_not_exist_is_not_stopped() -> None:
    assert not is_stopped(2**22 + 1)


async def test_the_guard_names_the_publishers_whose_process_is_stopped(
    child: Child,
) -> None:
    deaths = Deaths()
    watching = Guard(deaths)
    gid = gid_of(child.pid)
    assert watching.watch(gid, OWN_GID) == child.pid
    assert watching.stopped() == frozenset()
    stop(child)
    assert watching.stopped() == {gid}
    child.kill()
    assert await deaths.one() == [gid]
    assert watching.stopped() == frozenset()


# --- the end of a process


async def test_a_killed_process_is_reported_once_and_its_identity_cannot_be_watched_again(
    child: Child,
) -> None:
    deaths = Deaths()
    watching = Guard(deaths)
    gid = gid_of(child.pid)
    assert watching.watch(gid, OWN_GID) == child.pid
    assert watching.watch(gid, OWN_GID) == child.pid, "it is watched already"
    child.kill()
    assert await deaths.one() == [gid]
    assert watching.watch(gid, OWN_GID) is None


async def test_all_publishers_of_a_process_end_with_it(child: Child) -> None:
    deaths = Deaths()
    watching = Guard(deaths)
    gids = [gid_of(child.pid, entity) for entity in (1, 2)]
    assert [watching.watch(gid, OWN_GID) for gid in gids] == [child.pid] * 2
    child.kill()
    while len(deaths.gids) < 2:
        await deaths.one()
    assert sorted(deaths.gids) == gids


async def test_a_forgotten_publisher_is_not_reported(child: Child) -> None:
    deaths = Deaths()
    watching = Guard(deaths)
    forgotten, kept = gid_of(child.pid, 1), gid_of(child.pid, 2)
    for gid in (forgotten, kept):
        watching.watch(gid, OWN_GID)
    watching.forget([kept, gid_of(1)])
    child.kill()
    assert await deaths.one() == [kept]
    watching.forget([])
    assert deaths.gids == [kept]


async def test_a_process_that_ends_before_it_is_watched_is_not_watched(
    child: Child, monkeypatch: pytest.MonkeyPatch
) -> None:
    def ended(_: int) -> int:
        raise ProcessLookupError

    monkeypatch.setattr(os, "pidfd_open", ended)
    watching = Guard(Deaths())
    assert watching.watch(gid_of(child.pid), OWN_GID) is None
    assert watching.stopped() == frozenset()


async def test_a_publisher_of_another_host_is_not_watched(child: Child) -> None:
    assert Guard(Deaths()).watch(gid_of(child.pid, host=b"\x99\x99"), OWN_GID) is None
