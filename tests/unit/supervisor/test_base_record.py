"""What the base has shown, on the disk: it is read back, or ignored with one sentence, and no call waits for it."""

import json
import logging
import math
import os
import stat
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from supervisor.base_record import FORMAT, MAX_BYTES, BaseFile, BaseRecord, Shown, hash_of
from supervisor.config import SupervisorSection
from supervisor.law.base_braking import (
    GREATEST_M_S2,
    KEPT,
    LEAST_M_S2,
    LONGEST_DEAD_S,
    UNMEASURED,
    Braking,
)

LAW = SupervisorSection().law()
SHOWN = Shown(Braking(shown_m_s2=(1.2, 1.4), shown_dead_s=(0.0, 0.15)), mounts_confirmed=True)


def with_braking(**changes: object) -> Shown:
    return SHOWN._replace(braking=SHOWN.braking._replace(**changes))  # type: ignore[arg-type]


PATIENCE_S = 20.0


@pytest.fixture
def directory(tmp_path: Path) -> Path:
    """A state directory of this user alone, which does not exist yet."""
    return tmp_path / "state"


def written(directory: Path, **changes: Any) -> BaseFile:  # noqa: ANN401 - any JSON
    """A file with a good content, except for these changes."""
    file = BaseFile(directory, "robot", LAW)
    file.write(SHOWN)
    document = json.loads(file.path.read_text()) | changes
    file.path.write_text(json.dumps(document))
    return file


def until(condition: Callable[[], bool]) -> None:
    end_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end_s
        time.sleep(0.002)


# --- the file


def test_without_a_file_nothing_is_known(directory: Path) -> None:
    assert BaseFile(directory, "robot", LAW).read() == Shown()


def test_what_was_written_is_read_and_only_this_user_may_read_it(directory: Path) -> None:
    file = BaseFile(directory, "robot", LAW)
    file.write(SHOWN)
    assert BaseFile(directory, "robot", LAW).read() == SHOWN
    assert file.path == directory / "base-robot.json"
    assert stat.S_IMODE(file.path.stat().st_mode) == 0o600
    assert [path.name for path in directory.iterdir()] == ["base-robot.json"]


def test_only_results_are_kept(directory: Path) -> None:
    file = BaseFile(directory, "robot", LAW)
    file.write(with_braking(mean_m_s=0.7, stopping=True, whole_m=1.0, last_s=5.0))
    assert file.read() == SHOWN


@given(
    st.lists(st.floats(LEAST_M_S2, GREATEST_M_S2), max_size=KEPT),
    st.lists(st.floats(0.0, LONGEST_DEAD_S), max_size=KEPT),
)
def test_all_results_fit_into_the_file(braking: list[float], dead: list[float]) -> None:
    shown = UNMEASURED._replace(shown_m_s2=tuple(braking), shown_dead_s=tuple(dead))
    content = json.dumps(
        {"format": FORMAT, "law": hash_of(LAW), "braking_m_s2": braking, "dead_time_s": dead}
    )
    assert len(content) < MAX_BYTES / 2
    parse = BaseFile(Path("/nowhere"), "robot", LAW)._parse  # pyright: ignore[reportPrivateUsage]
    assert parse(content.encode()) == Shown(shown)


def test_a_new_result_replaces_the_file_and_a_leftover_of_an_interrupted_write(directory: Path) -> None:
    file = BaseFile(directory, "robot", LAW)
    file.write(SHOWN)
    file.path.with_suffix(".new").write_text("half")
    better = with_braking(shown_m_s2=(2.0,))
    file.write(better)
    assert file.read() == better
    assert len(list(directory.iterdir())) == 1


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"format": 2}, "another format"),
        ({"law": "0" * 64}, "another configuration"),
        ({"braking_m_s2": None}, "damaged"),
        ({"braking_m_s2": 1.5}, "damaged"),
        ({"braking_m_s2": [1]}, "damaged"),
        ({"braking_m_s2": [True]}, "damaged"),
        ({"braking_m_s2": ["1.5"]}, "damaged"),
        ({"braking_m_s2": [math.nan]}, "damaged"),
        ({"braking_m_s2": [math.inf]}, "damaged"),
        ({"braking_m_s2": [math.nextafter(LEAST_M_S2, 0.0)]}, "damaged"),
        ({"braking_m_s2": [math.nextafter(GREATEST_M_S2, 11.0)]}, "damaged"),
        ({"braking_m_s2": [1.5] * (KEPT + 1)}, "damaged"),
        ({"dead_time_s": [-0.001]}, "damaged"),
        ({"dead_time_s": [math.nextafter(LONGEST_DEAD_S, 1.0)]}, "damaged"),
        ({"dead_time_s": {}}, "damaged"),
    ],
)
def test_a_content_that_the_law_would_not_write_is_refused(
    directory: Path, changes: dict[str, object], sentence: str
) -> None:
    with pytest.raises(ValueError, match=sentence):
        written(directory, **changes).read()


def test_the_limits_of_the_results_are_accepted(directory: Path) -> None:
    file = written(
        directory,
        braking_m_s2=[LEAST_M_S2, GREATEST_M_S2] * (KEPT // 2),
        dead_time_s=[0.0, LONGEST_DEAD_S] * (KEPT // 2),
    )
    braking = file.read().braking
    assert len(braking.shown_m_s2) == len(braking.shown_dead_s) == KEPT


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b"\xff", b"[" * MAX_BYTES, b" " * (MAX_BYTES + 1)])
def test_a_damaged_file_is_refused(directory: Path, content: bytes) -> None:
    file = written(directory)
    file.path.write_bytes(content)
    with pytest.raises(ValueError, match=r"damaged|too long|format"):
        file.read()


def test_each_part_of_the_configuration_is_part_of_the_hash_and_what_was_measured_is_not() -> None:
    assert hash_of(replace(LAW, shown_m_s2=1.0, shown_dead_s=0.2)) == hash_of(LAW)
    others = [
        replace(LAW, deceleration_m_s2=1.4),
        replace(LAW, base_dead_time_s=0.1),
        replace(LAW, hull=SupervisorSection.model_validate({"footprint": {"radius_m": 0.3}}).law().hull),
        replace(LAW, unmeasured_m_s=0.5),
    ]
    assert len({hash_of(LAW), *map(hash_of, others)}) == 5


def test_the_results_of_another_robot_are_not_read(directory: Path) -> None:
    written(directory)
    assert BaseFile(directory, "r2", LAW).read() == Shown()


def link(path: Path) -> None:
    path.symlink_to("/etc/hostname")


@pytest.mark.parametrize("make", [Path.mkdir, link, os.mkfifo])
def test_what_only_has_the_name_of_the_file_is_refused(directory: Path, make: Callable[[Path], None]) -> None:
    file = written(directory)
    file.path.unlink()
    make(file.path)
    with pytest.raises((ValueError, OSError)):
        file.read()


def test_a_file_or_a_directory_that_others_can_change_is_refused(directory: Path) -> None:
    file = written(directory)
    file.path.chmod(0o622)
    with pytest.raises(ValueError, match="other users can change it"):
        file.read()
    file.path.chmod(0o600)
    directory.chmod(0o777)
    for use in (file.read, lambda: file.write(SHOWN)):
        with pytest.raises(ValueError, match="other users can change it"):
            use()


# --- the thread


class FakeFile(BaseFile):
    """A disk that can hang and fail."""

    def __init__(self) -> None:
        super().__init__(Path("/nowhere"), "robot", LAW)
        self.works = threading.Event()
        self.works.set()
        self.failing = ""
        self.found = Shown()
        self.written: list[Shown] = []

    def _use(self) -> None:
        assert self.works.wait(PATIENCE_S)
        if self.failing:
            raise OSError(self.failing)

    def read(self) -> Shown:
        self._use()
        return self.found

    def write(self, shown: Shown) -> None:
        self._use()
        self.written.append(shown)


def test_the_results_of_the_last_supervisor_count_and_are_not_written_again() -> None:
    file = FakeFile()
    file.found = SHOWN
    record = BaseRecord(file)
    assert record.at_start == SHOWN
    record.keep(with_braking(mean_m_s=0.5))
    record.close()
    assert file.written == []


@pytest.mark.parametrize(
    "shown",
    [
        with_braking(shown_m_s2=(1.1,)),
        with_braking(shown_dead_s=(0.2,)),
        SHOWN._replace(mounts_confirmed=False),
    ],
)
def test_each_result_is_written_once(shown: Shown) -> None:
    file = FakeFile()
    file.found = SHOWN
    record = BaseRecord(file)
    for number in range(3):
        record.keep(shown._replace(braking=shown.braking._replace(mean_m_s=0.1 * number)))
    record.close()
    assert file.written == [shown]


@pytest.mark.parametrize("value", [None, 1, "true", []])
def test_a_mounting_is_confirmed_by_nothing_but_true(directory: Path, value: object) -> None:
    assert written(directory).read().mounts_confirmed
    assert not written(directory, mounts_confirmed=value).read().mounts_confirmed


def test_no_call_waits_for_the_disk() -> None:
    file = FakeFile()
    record = BaseRecord(file)
    file.works.clear()
    began_s = time.monotonic()
    for number in range(5):
        record.keep(with_braking(shown_m_s2=(1.0 + number,)))
    assert time.monotonic() - began_s < 0.2
    file.works.set()
    until(lambda: len(file.written) == 5)


def test_a_disk_that_hangs_at_the_start_leaves_the_robot_unknown(caplog: pytest.LogCaptureFixture) -> None:
    file = FakeFile()
    file.found = SHOWN
    file.works.clear()
    record = BaseRecord(file, read_limit_s=0.02)
    assert record.at_start == Shown()
    assert "nothing counts as measured" in caplog.text
    file.works.set()
    record.keep(with_braking(shown_m_s2=(1.0,)))
    until(lambda: len(file.written) == 1)


def test_a_file_that_cannot_be_read_is_ignored_with_one_sentence(caplog: pytest.LogCaptureFixture) -> None:
    file = FakeFile()
    file.failing = "no\x1b such disk"
    record = BaseRecord(file)
    assert record.at_start == Shown()
    (message,) = caplog.messages
    assert "is ignored, so nothing counts as measured: no" in message
    assert "\x1b" not in message


def test_a_file_that_cannot_be_written_is_a_warning_and_is_written_after_the_next_result(
    caplog: pytest.LogCaptureFixture,
) -> None:
    caplog.set_level(logging.WARNING)
    file = FakeFile()
    record = BaseRecord(file)
    file.failing = "no space"
    record.keep(with_braking(shown_m_s2=(1.0,)))
    record.keep(with_braking(shown_m_s2=(1.1,)))
    until(lambda: len(caplog.messages) == 1)
    assert "is lost at the next start: no space" in caplog.text
    time.sleep(0.02)
    file.failing = ""
    record.keep(SHOWN)
    record.close()
    assert file.written == [SHOWN]
    assert len(caplog.messages) == 1


def test_a_robot_keeps_its_results_across_a_restart(directory: Path) -> None:
    first = BaseRecord(BaseFile(directory, "robot", LAW))
    assert first.at_start == Shown()
    first.keep(SHOWN)
    first.close()
    assert BaseRecord(BaseFile(directory, "robot", LAW)).at_start == SHOWN
