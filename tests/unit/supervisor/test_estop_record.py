"""The e-stop record's thread: the newest request wins, no caller waits for the disk, and failures are retried."""

import threading
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from supervisor.estop_record import (
    PREPARE_PENDING,
    PRESS_PENDING,
    RESET_PENDING,
    EstopRecord,
    MemoryRecord,
    RecordError,
    RecordFiles,
)

PATIENCE_S = 20.0
OFTEN_S = 0.002
NEVER_S = 3600.0


class FakeDisk(RecordFiles):
    """A disk that can hang, fail, and be changed behind the supervisor's back."""

    def __init__(self, *, latched: bool = False) -> None:
        self.latched = latched
        self.ready = False
        self.works = threading.Event()
        self.works.set()
        self.failing = ""
        self.attempts: list[str] = []
        self.closed = threading.Event()
        self._naming = threading.Lock()

    def _change(self, what: str) -> None:
        self.attempts.append(what)
        assert self.works.wait(PATIENCE_S)
        if self.failing:
            raise RecordError(self.failing)

    def read(self) -> bool:
        self._change("read")
        return self.latched

    def mark(self, is_wanted: Callable[[], bool]) -> None:
        """Whether the disk is intact; a hanging one is, a broken one refuses."""
        if self.failing:
            raise RecordError(self.failing)
        with self._naming:
            if is_wanted():
                self.latched = True

    def latch(self) -> None:
        self._change("latch")
        with self._naming:
            self.latched = True

    def clear(self, is_wanted: Callable[[], bool]) -> None:
        self._change("clear")
        with self._naming:
            if is_wanted():
                self.latched = False

    def prepare(self) -> None:
        self._change("prepare")
        self.ready = True

    def holds(self, *, latched: bool) -> bool:
        return self.latched if latched else self.ready

    def close(self) -> None:
        self.closed.set()


@contextmanager
def recording(disk: FakeDisk, period_s: float = NEVER_S) -> Generator[EstopRecord]:
    record = EstopRecord(disk, period_s=period_s)
    try:
        yield record
    finally:
        disk.works.set()
        record.close()
        assert disk.closed.wait(PATIENCE_S)


def until(condition: Callable[[], bool]) -> None:
    deadline_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline_s
        time.sleep(OFTEN_S)


def settled(record: EstopRecord) -> str:
    until(lambda: not record.is_pending)
    return record.problem


def test_a_supervisor_without_a_record_starts_free_and_prepares_a_press() -> None:
    disk = FakeDisk()
    with recording(disk) as record:
        assert not record.latched_at_start
        assert settled(record) == ""
        assert disk.attempts == ["read", "prepare"]


def test_a_supervisor_that_finds_a_record_starts_latched_and_makes_it_durable() -> None:
    disk = FakeDisk(latched=True)
    with recording(disk) as record:
        assert record.latched_at_start
        assert settled(record) == ""
        assert disk.attempts == ["read", "latch"]


def test_who_pressed_is_told_after_a_restart_and_forgotten_with_a_reset(tmp_path: Path) -> None:
    by = "pressed by teleop, 2026-11-26 14:20:05"
    for latched, found in ((True, ""), (False, by), (True, "")):
        record = EstopRecord(RecordFiles(tmp_path, "robot"), period_s=NEVER_S)
        assert (record.latched_at_start, record.by) == (bool(found), found)
        record.by = by if latched else ""
        record.keep(latched=latched)
        assert settled(record) == ""
        record.close()


def test_a_record_that_cannot_be_read_latches_and_is_written() -> None:
    disk = FakeDisk()
    disk.failing = "no such luck"
    with recording(disk, period_s=OFTEN_S) as record:
        assert record.latched_at_start
        assert settled(record) == "no such luck"
        disk.failing = ""
        until(lambda: record.problem == "")
        assert disk.latched


def test_a_disk_that_does_not_answer_latches() -> None:
    disk = FakeDisk()
    disk.works.clear()
    record = EstopRecord(disk, period_s=NEVER_S, read_limit_s=0.05)
    assert record.latched_at_start
    assert record.problem == PRESS_PENDING
    disk.works.set()
    assert settled(record) == ""
    assert disk.latched
    record.close()


def test_asking_waits_for_no_disk_and_the_status_knows_what_is_not_written_yet() -> None:
    disk = FakeDisk()
    with recording(disk) as record:
        assert settled(record) == ""
        disk.works.clear()
        record.keep(latched=True)
        until(lambda: disk.attempts[-1] == "latch")
        assert record.is_pending
        assert record.problem == PRESS_PENDING
        record.keep(latched=False)
        assert record.problem == RESET_PENDING
        record.keep(latched=True)
        assert record.problem == PRESS_PENDING
        disk.works.set()
        assert settled(record) == ""
        assert disk.latched


def test_before_the_disk_was_tried_nothing_is_known() -> None:
    disk = FakeDisk()
    holding = threading.Event()
    prepare = disk.prepare

    def hold() -> None:
        assert holding.wait(PATIENCE_S)
        prepare()

    disk.prepare = hold
    record = EstopRecord(disk, period_s=NEVER_S, read_limit_s=0.05)
    assert record.problem == PREPARE_PENDING
    holding.set()
    assert settled(record) == ""
    record.close()


def test_a_start_waits_until_a_press_could_be_recorded() -> None:
    with recording(FakeDisk()) as record:
        assert record.problem == ""


def test_a_press_during_the_writing_of_a_reset_is_written_after_it() -> None:
    disk = FakeDisk(latched=True)
    with recording(disk) as record:
        assert settled(record) == ""
        disk.works.clear()
        record.keep(latched=False)
        until(lambda: disk.attempts[-1] == "clear")
        record.keep(latched=True)
        disk.works.set()
        assert settled(record) == ""
        assert disk.latched


def test_a_press_is_marked_while_the_disk_hangs() -> None:
    disk = FakeDisk()
    with recording(disk) as record:
        assert settled(record) == ""
        assert record.is_marked
        disk.works.clear()
        record.keep(latched=True)
        until(lambda: record.is_marked)
        assert disk.latched
        assert record.problem == PRESS_PENDING, "it would not survive a power failure yet"
        disk.works.set()
        assert settled(record) == ""


def test_a_press_that_was_marked_during_the_writing_of_a_reset_is_not_removed_by_it() -> None:
    disk = FakeDisk(latched=True)
    with recording(disk) as record:
        assert settled(record) == ""
        disk.works.clear()
        record.keep(latched=False)
        until(lambda: disk.attempts[-1] == "clear")
        record.keep(latched=True)
        until(lambda: record.is_marked)
        removed: list[bool] = []
        latch = disk.latch

        def look() -> None:
            removed.append(not disk.latched)
            latch()

        disk.latch = look
        disk.works.set()
        assert settled(record) == ""
        assert removed == [False]


def test_asking_for_the_same_again_touches_no_disk() -> None:
    disk = FakeDisk()
    with recording(disk) as record:
        record.keep(latched=True)
        assert settled(record) == ""
        attempts = list(disk.attempts)
        record.keep(latched=True)
        assert not record.is_pending
        assert disk.attempts == attempts


def test_what_failed_is_tried_again_until_it_succeeds(caplog: pytest.LogCaptureFixture) -> None:
    disk = FakeDisk()
    with recording(disk, period_s=OFTEN_S) as record:
        disk.failing = "the disk is full"
        record.keep(latched=True)
        assert settled(record) == "the disk is full"
        until(lambda: disk.attempts.count("latch") > 3)
        assert sum("the disk is full" in r.message for r in caplog.records) == 1, "said once"
        disk.failing = ""
        until(lambda: record.problem == "")
        assert disk.latched


def test_an_error_without_words_is_named_by_its_type() -> None:
    disk = FakeDisk()
    with recording(disk) as record:

        def fail() -> None:
            raise MemoryError

        disk.latch = fail
        record.keep(latched=True)
        assert settled(record) == "MemoryError"


def test_a_record_that_is_deleted_while_latched_is_written_again() -> None:
    disk = FakeDisk(latched=True)
    with recording(disk, period_s=OFTEN_S) as record:
        assert settled(record) == ""
        disk.latched = False
        until(lambda: disk.latched)


def test_a_disk_that_can_no_longer_be_looked_at_is_tried_again() -> None:
    disk = FakeDisk()
    with recording(disk, period_s=OFTEN_S) as record:
        assert settled(record) == ""

        def fail(*, latched: bool) -> bool:
            raise OSError(f"gone, latched={latched}")

        disk.holds = fail
        until(lambda: disk.attempts.count("prepare") > 3)
        assert "clear" not in disk.attempts


def test_any_error_at_a_look_at_the_disk_is_retried_and_ends_no_thread() -> None:
    disk = FakeDisk()
    looks: list[bool] = []

    def without_memory(*, latched: bool) -> bool:
        looks.append(latched)
        raise MemoryError

    disk.holds = without_memory
    with recording(disk, period_s=OFTEN_S) as record:
        until(lambda: len(looks) > 1)
        record.keep(latched=True)
        assert settled(record) == ""
        assert disk.latched


def test_only_a_reset_clears_a_record_that_appears_later() -> None:
    disk = FakeDisk(latched=True)
    with recording(disk, period_s=OFTEN_S) as record:
        record.keep(latched=False)
        assert settled(record) == ""
        disk.latched, disk.ready = True, False  # by hand, or by a second supervisor
        until(lambda: disk.ready)
        assert disk.latched
        assert disk.attempts.count("clear") == 1


def test_a_reset_that_could_not_be_written_is_tried_again() -> None:
    disk = FakeDisk(latched=True)
    with recording(disk, period_s=OFTEN_S) as record:
        assert settled(record) == ""
        disk.failing = "cannot clear"
        record.keep(latched=False)
        assert settled(record) == "cannot clear"
        assert disk.latched
        disk.failing = ""
        until(lambda: not disk.latched)


def test_a_change_is_announced() -> None:
    disk, announced = FakeDisk(), threading.Event()
    with recording(disk) as record:
        assert settled(record) == ""
        record.watch(announced.set)
        record.keep(latched=True)
        assert announced.wait(PATIENCE_S)


def test_closing_finishes_the_newest_request() -> None:
    disk = FakeDisk()
    record = EstopRecord(disk, period_s=NEVER_S)
    record.keep(latched=True)
    record.close()
    assert disk.latched
    assert disk.closed.is_set()


@given(st.lists(st.booleans(), max_size=20))
def test_after_any_presses_and_resets_the_disk_holds_the_last_one(wishes: list[bool]) -> None:
    disk = FakeDisk()
    record = EstopRecord(disk, period_s=NEVER_S)
    for latched in wishes:
        record.keep(latched=latched)
        if latched and record.problem == "":
            assert disk.latched, "shown as recorded, and not recorded"
    record.close()
    assert disk.closed.wait(PATIENCE_S)
    assert disk.latched is (wishes[-1] if wishes else False)


def test_a_record_in_memory_lasts_as_long_as_its_object() -> None:
    record = MemoryRecord()
    assert not record.latched_at_start
    record.keep(latched=True)
    record.close()
    assert record.latched_at_start
    assert record.problem == ""
