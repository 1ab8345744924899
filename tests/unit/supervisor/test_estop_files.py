"""The e-stop record's files: at a start, and after a crash at any moment."""

import errno
import os
import threading
from collections.abc import Callable, Generator
from pathlib import Path
from typing import Any

import pytest

from supervisor.estop_record import (
    MAX_BYTES,
    EstopRecord,
    RecordError,
    RecordFiles,
    is_recorded,
    pressed_by,
    record_path,
)
from wire.messages import String, encode

ROBOT = "robot"


class Crash(BaseException):
    """The process ends here."""


@pytest.fixture
def files(tmp_path: Path) -> Generator[RecordFiles]:
    files = RecordFiles(tmp_path / "state", ROBOT)
    yield files
    files.close()


def still_wanted() -> bool:
    return True


def failing(number: int) -> Callable[..., Any]:
    """Return a stand-in for a disk call that raises this error, with its path if it has one."""

    def fail(*arguments: object, **_: object) -> Any:  # noqa: ANN401
        raise OSError(
            number, os.strerror(number), *(str(one) for one in arguments[:1] if isinstance(one, str | Path))
        )

    return fail


def read_anew(directory: Path, namespace: str = ROBOT) -> bool:
    """Read the record as the next process does."""
    files = RecordFiles(directory, namespace)
    try:
        return files.read()
    finally:
        files.close()


def test_a_first_start_finds_no_record_and_makes_the_directory(files: RecordFiles, tmp_path: Path) -> None:
    assert not files.read()
    assert not is_recorded(tmp_path / "state", ROBOT)
    assert (tmp_path / "state").stat().st_mode & 0o777 == 0o700


def test_a_press_is_found_until_it_is_cleared(files: RecordFiles, tmp_path: Path) -> None:
    files.prepare()
    files.latch()
    files.close()
    assert read_anew(tmp_path / "state")
    assert is_recorded(tmp_path / "state", ROBOT)
    assert "reset the e-stop" in record_path(tmp_path / "state", ROBOT).read_text()
    files.clear(still_wanted)
    files.close()
    assert not read_anew(tmp_path / "state")


def test_the_record_says_who_pressed_and_when_to_the_next_process(files: RecordFiles, tmp_path: Path) -> None:
    files.latch()
    assert pressed_by(tmp_path / "state", ROBOT) == ""
    files.describe("pressed by some_station, 2026-11-26 14:20:05")
    files.describe("pressed by joy, 2026-11-26 14:20:06")
    assert (
        pressed_by(tmp_path / "state", ROBOT) == files.description() == "pressed by joy, 2026-11-26 14:20:06"
    )
    assert "reset the e-stop" in record_path(tmp_path / "state", ROBOT).read_text()
    files.clear(still_wanted)
    assert files.description() == ""


@pytest.mark.parametrize("content", [b"", b"\xff\x00", b"pressed by \x1b[2J", b"x" * 5000])
def test_a_record_with_any_content_latches_and_cannot_control_a_terminal(
    content: bytes, tmp_path: Path
) -> None:
    record_path(tmp_path, ROBOT).write_bytes(content)
    assert read_anew(tmp_path)
    assert pressed_by(tmp_path, ROBOT).isprintable()


def test_the_description_of_a_record_of_any_size_is_short(tmp_path: Path) -> None:
    record_path(tmp_path, ROBOT).write_bytes(b"x\npressed by " + b"\x1b[2J" * 250_000)
    said = pressed_by(tmp_path, ROBOT)
    assert said.startswith("pressed by ?[2J")
    assert len(said) <= MAX_BYTES


def test_a_record_that_is_no_file_says_nothing_and_does_not_block(tmp_path: Path) -> None:
    os.mkfifo(record_path(tmp_path, ROBOT))
    assert pressed_by(tmp_path, ROBOT) == ""
    record_path(tmp_path, "other").mkdir()
    assert pressed_by(tmp_path, "other") == ""


def test_a_description_never_makes_a_record(files: RecordFiles) -> None:
    with pytest.raises(FileNotFoundError):
        files.describe("pressed by teleop")
    assert not files.read()


def test_pressing_twice_and_clearing_twice_changes_nothing_more(files: RecordFiles) -> None:
    files.latch()
    files.latch()
    assert files.read()
    files.clear(still_wanted)
    files.clear(still_wanted)
    assert not files.read()


def test_a_mark_is_found_by_the_next_process_with_and_without_a_prepared_file(
    files: RecordFiles, tmp_path: Path
) -> None:
    files.prepare()
    for _ in range(2):
        files.mark(still_wanted)
        files.mark(still_wanted)
        files.close()
        assert read_anew(tmp_path / "state")
        assert "reset the e-stop" in record_path(tmp_path / "state", ROBOT).read_text()
        files.clear(still_wanted)
    assert not files.read()


@pytest.mark.parametrize("number", [errno.EBUSY, errno.EPERM, errno.EXDEV, errno.EIO])
def test_a_press_is_recorded_on_a_disk_that_refuses_only_the_rename(
    number: int, files: RecordFiles, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files.prepare()
    monkeypatch.setattr(Path, "rename", failing(number))
    files.latch()
    files.close()
    assert read_anew(tmp_path / "state")


def test_a_rename_that_reports_an_error_and_was_done_all_the_same_keeps_its_record(
    files: RecordFiles, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files.prepare()
    rename = Path.rename

    def done(path: Path, target: Path) -> Path:
        rename(path, target)
        inode.append(target.lstat().st_ino)
        raise OSError(errno.EIO, "the answer of the server was lost", str(path))

    inode: list[int] = []
    monkeypatch.setattr(Path, "rename", done)
    files.latch()
    files.close()
    assert record_path(tmp_path / "state", ROBOT).lstat().st_ino == inode[0], "it was missing for a moment"
    assert read_anew(tmp_path / "state")


def test_a_press_on_a_disk_that_refuses_every_change_is_reported_and_latches_the_next_start_there(
    files: RecordFiles, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files.prepare()
    for owner, name in ((Path, "rename"), (Path, "unlink"), (os, "open")):
        monkeypatch.setattr(owner, name, failing(errno.EIO))
    with pytest.raises(RecordError, match="the e-stop cannot be recorded: Input/output error"):
        files.latch()
    files.close()
    record = EstopRecord(RecordFiles(tmp_path / "state", ROBOT))
    assert record.latched_at_start
    assert record.problem
    record.close()


def test_a_mark_that_is_no_longer_wanted_leaves_nothing(files: RecordFiles) -> None:
    files.prepare()
    files.mark(lambda: False)
    assert not files.read()


def test_a_reset_that_is_no_longer_wanted_removes_nothing(files: RecordFiles) -> None:
    files.latch()
    files.clear(lambda: False)
    assert files.read()


def test_a_mark_does_not_wait_for_the_disk(files: RecordFiles, monkeypatch: pytest.MonkeyPatch) -> None:
    files.prepare()
    waits, goes_on = threading.Event(), threading.Event()

    def slow(_: int) -> None:
        waits.set()
        assert goes_on.wait(20.0)

    monkeypatch.setattr(os, "fsync", slow)
    preparing = threading.Thread(target=files.prepare)
    preparing.start()
    assert waits.wait(20.0)
    files.mark(still_wanted)
    assert files.read()
    goes_on.set()
    preparing.join()
    assert files.read()


def test_each_namespace_has_a_record_of_its_own(files: RecordFiles, tmp_path: Path) -> None:
    files.latch()
    assert not read_anew(tmp_path / "state", "other")
    other = RecordFiles(tmp_path / "state", "other")
    other.clear(still_wanted)
    other.close()
    assert files.read()


def test_a_prepared_press_needs_no_space_on_the_disk(
    files: RecordFiles, monkeypatch: pytest.MonkeyPatch
) -> None:
    files.prepare()
    monkeypatch.setattr(os, "write", failing(errno.ENOSPC))
    files.latch()
    assert files.read()


def test_a_full_disk_is_named_before_anybody_presses(
    files: RecordFiles, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "write", failing(errno.ENOSPC))
    with pytest.raises(RecordError, match="a pressed e-stop could not be recorded: No space left on device"):
        files.prepare()


def a_directory(path: Path) -> None:
    path.mkdir()


def a_dangling_link(path: Path) -> None:
    path.symlink_to("nowhere")


def a_loop_of_links(path: Path) -> None:
    path.symlink_to(path.name)


def an_empty_file(path: Path) -> None:
    path.touch()


def garbage(path: Path) -> None:
    path.write_bytes(b"\xff" * 5000)


@pytest.mark.parametrize("put", [a_directory, a_dangling_link, a_loop_of_links, an_empty_file, garbage])
def test_whatever_has_the_records_name_counts_as_one(put: Callable[[Path], None], tmp_path: Path) -> None:
    put(record_path(tmp_path, ROBOT))
    assert read_anew(tmp_path)
    assert is_recorded(tmp_path, ROBOT)


def test_a_directory_in_the_records_place_stays_latched_and_says_that_it_cannot_be_cleared(
    tmp_path: Path,
) -> None:
    record_path(tmp_path, ROBOT).mkdir()
    files = RecordFiles(tmp_path, ROBOT)
    files.latch()
    with pytest.raises(RecordError, match=r"the reset cannot be recorded.*Is a directory"):
        files.clear(still_wanted)
    files.close()
    assert read_anew(tmp_path)


def test_a_link_to_a_disk_that_is_not_mounted_proves_nothing(tmp_path: Path) -> None:
    (tmp_path / "state").symlink_to(tmp_path / "disk")
    with pytest.raises(FileExistsError):
        read_anew(tmp_path / "state")
    assert is_recorded(tmp_path / "state", ROBOT)
    (tmp_path / "disk").mkdir()
    assert not read_anew(tmp_path / "state")
    assert not is_recorded(tmp_path / "state", ROBOT)


def test_a_state_directory_that_is_a_file_proves_nothing(tmp_path: Path) -> None:
    (tmp_path / "state").write_text("")
    with pytest.raises(FileExistsError):
        read_anew(tmp_path / "state")
    assert is_recorded(tmp_path / "state", ROBOT)
    files = RecordFiles(tmp_path / "state", ROBOT)
    with pytest.raises(RecordError, match="the e-stop cannot be recorded"):
        files.latch()


def test_a_record_that_may_not_be_looked_up_proves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Path, "lstat", failing(errno.EACCES))
    assert is_recorded(tmp_path, ROBOT)
    with pytest.raises(PermissionError):
        read_anew(tmp_path)


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT, errno.EROFS])
def test_a_start_where_no_earlier_press_could_have_been_recorded_proves_nothing(
    number: int, files: RecordFiles, monkeypatch: pytest.MonkeyPatch
) -> None:
    files.prepare()
    monkeypatch.setattr(os, "write", failing(number))
    with pytest.raises(OSError, match=os.strerror(number)):
        files.read()


def test_a_read_only_directory_proves_nothing_and_is_named(
    files: RecordFiles, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "state").mkdir()
    opened = os.open

    def read_only(path: Any, flags: int, mode: int = 0o777) -> int:  # noqa: ANN401
        if flags & os.O_CREAT:
            raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(path))
        return opened(path, flags, mode)

    monkeypatch.setattr(os, "open", read_only)
    with pytest.raises(OSError, match="Read-only"):
        files.read()
    with pytest.raises(
        RecordError, match=r"a pressed e-stop could not be recorded: Read-only file system \(.*lock\)"
    ):
        files.prepare()


def test_a_directory_that_others_can_change_proves_nothing_and_is_named(tmp_path: Path) -> None:
    directory = tmp_path / "state"
    files = RecordFiles(directory, ROBOT)
    files.prepare()
    assert files.holds(latched=False)
    directory.chmod(0o777)
    assert not files.holds(latched=False), "while it runs, too"
    sentence = rf"a pressed e-stop could not be recorded: .*`chmod 755 {directory}`"
    with pytest.raises(RecordError, match=sentence):
        files.prepare()
    with pytest.raises(RecordError, match="so that other users can change it"):
        read_anew(directory)
    with pytest.raises(RecordError, match="so that other users can change it"):
        files.latch()
    assert record_path(directory, ROBOT).exists(), "a press is recorded all the same"
    directory.chmod(0o755)
    files.latch()
    files.close()


def a_fifo(path: Path) -> None:
    os.mkfifo(path)


def a_link_to_a_file(path: Path) -> None:
    path.symlink_to("../kept")


def a_hard_link(path: Path) -> None:
    path.hardlink_to(path.parents[1] / "kept")


@pytest.mark.parametrize("put", [a_fifo, a_link_to_a_file, a_hard_link])
@pytest.mark.parametrize("name", ["estop-robot.ready", "estop-robot.latched", "estop-robot.lock"])
def test_nothing_with_a_name_of_the_record_makes_it_overwrite_another_file(
    name: str, put: Callable[[Path], None], tmp_path: Path
) -> None:
    (tmp_path / "kept").write_text("kept")
    (tmp_path / "state").mkdir(mode=0o700)
    put(tmp_path / "state" / name)
    files = RecordFiles(tmp_path / "state", ROBOT)
    if (name, put) == ("estop-robot.lock", a_link_to_a_file):
        with pytest.raises(RecordError, match=r"symbolic links .*estop-robot.lock"):
            files.prepare()
    else:
        files.prepare()
        files.latch()
        assert files.read()
    files.close()
    assert (tmp_path / "kept").read_text() == "kept"


def test_who_pressed_is_not_written_into_a_file_that_was_linked_in_the_place_of_the_prepared_record(
    files: RecordFiles, tmp_path: Path
) -> None:
    files.prepare()
    kept, ready = tmp_path / "kept", tmp_path / "state" / "estop-robot.ready"
    kept.write_text("kept")
    ready.unlink()
    ready.hardlink_to(kept)
    files.latch()
    files.describe("pressed by teleop, 2026-11-26 14:20:05")
    assert kept.read_text() == "kept"
    assert files.read()


def test_a_second_supervisor_of_the_namespace_proves_nothing_and_clears_nothing(
    files: RecordFiles, tmp_path: Path
) -> None:
    files.prepare()
    second = RecordFiles(tmp_path / "state", ROBOT)
    with pytest.raises(RecordError, match="another supervisor holds"):
        second.read()
    with pytest.raises(RecordError, match="a pressed e-stop could not be recorded: another supervisor holds"):
        second.prepare()
    files.latch()
    with pytest.raises(RecordError, match="another supervisor holds"):
        second.clear(still_wanted)
    assert files.read()


def test_a_press_at_a_second_supervisor_is_recorded_all_the_same(files: RecordFiles, tmp_path: Path) -> None:
    files.prepare()
    second = RecordFiles(tmp_path / "state", ROBOT)
    with pytest.raises(RecordError, match="the e-stop cannot be recorded: another supervisor holds"):
        second.latch()
    assert files.read()


def test_a_problem_of_a_directory_with_any_name_fits_into_a_status_and_the_log(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    directory = tmp_path / os.fsdecode(b"state\xff\n")
    directory.mkdir()
    directory.chmod(0o777)
    record = EstopRecord(RecordFiles(directory, ROBOT))
    record.close()
    assert "state??" in record.problem
    assert encode(String(record.problem))
    assert "state??" in caplog.text
    assert caplog.text.encode(), "no part of the name is without a character"


@pytest.mark.parametrize("earlier_mode", [None, 0o644])
def test_another_user_cannot_hold_the_lock_in_a_directory_that_everyone_may_enter(
    earlier_mode: int | None, tmp_path: Path
) -> None:
    directory, umask = tmp_path / "state", os.umask(0o022)
    try:
        directory.mkdir(mode=0o755)
        if earlier_mode is not None:
            (directory / "estop-robot.lock").touch(earlier_mode)
        files = RecordFiles(directory, ROBOT)
        assert not files.read()
        files.close()
        assert (directory / "estop-robot.lock").stat().st_mode & 0o077 == 0
    finally:
        os.umask(umask)


def test_the_lock_passes_to_the_next_process(files: RecordFiles, tmp_path: Path) -> None:
    files.latch()
    files.close()
    second = RecordFiles(tmp_path / "state", ROBOT)
    second.clear(still_wanted)
    second.close()


def test_a_deleted_state_directory_is_noticed_and_made_again(files: RecordFiles, tmp_path: Path) -> None:
    files.latch()
    assert files.holds(latched=True)
    for path in (tmp_path / "state").iterdir():
        path.unlink()
    (tmp_path / "state").rmdir()
    assert not files.holds(latched=True)
    files.latch()
    assert files.holds(latched=True)
    files.close()
    assert read_anew(tmp_path / "state")


def test_a_press_that_could_no_longer_be_recorded_is_noticed(
    files: RecordFiles, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert not files.holds(latched=False)
    files.prepare()
    assert files.holds(latched=False)

    def refused(_path: Path, _mode: int) -> bool:
        return False

    monkeypatch.setattr(os, "access", refused)
    assert not files.holds(latched=False)
    monkeypatch.undo()
    (tmp_path / "state" / "estop-robot.ready").unlink()
    assert not files.holds(latched=False)


CHANGES = ("rename", "unlink", "open", "write", "fsync", "close")


def crash_before(number: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """End the process before its nth change of the disk."""
    left = number

    def counted(call: Callable[..., Any]) -> Callable[..., Any]:
        def change(*arguments: Any, **options: Any) -> Any:  # noqa: ANN401
            nonlocal left
            left -= 1
            if left < 0:
                raise Crash
            return call(*arguments, **options)

        return change

    for name in CHANGES:
        monkeypatch.setattr(os, name, counted(getattr(os, name)))
    monkeypatch.setattr(Path, "rename", counted(Path.rename))
    monkeypatch.setattr(Path, "unlink", counted(Path.unlink))


def crashed(directory: Path, number: int, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Press, reset, press until the crash; return the completed requests."""
    files = RecordFiles(directory, ROBOT)
    files.prepare()
    finished: list[str] = []
    with monkeypatch.context() as patched:
        crash_before(number, patched)
        try:
            for name in ("latch", "clear", "prepare", "latch"):
                if name == "clear":
                    files.clear(still_wanted)
                else:
                    getattr(files, name)()
                finished.append(name)
        except Crash:
            pass
    files.close()
    return finished


def test_a_crash_at_any_change_leaves_what_was_finished_or_a_latched_estop(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    finished_of_each: list[list[str]] = []
    for number in range(100):
        directory = tmp_path / str(number)
        finished = crashed(directory, number, monkeypatch)
        finished_of_each.append(finished)
        latched = read_anew(directory)
        if finished and finished[-1] == "latch":
            # The reset after it was not completed, if it was begun.
            assert latched or len(finished) == 1, number
        if len(finished) == 4:
            assert latched
            break
    assert [len(f) for f in finished_of_each] == sorted(len(f) for f in finished_of_each)
    assert {len(f) for f in finished_of_each} == {0, 1, 2, 3, 4}


def test_a_press_is_on_disk_only_after_its_rename_was_synchronised(
    files: RecordFiles, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files.prepare()
    done: list[str] = []
    rename, fsync = Path.rename, os.fsync

    def renamed(path: Path, target: Path) -> Path:
        done.append("rename")
        return rename(path, target)

    def synchronised(file: int) -> None:
        done.append(Path(f"/proc/self/fd/{file}").readlink().name)
        fsync(file)

    monkeypatch.setattr(Path, "rename", renamed)
    monkeypatch.setattr(os, "fsync", synchronised)
    files.latch()
    assert done == ["rename", "state"]
    done.clear()
    files.latch()
    assert done == ["state"], "a record that was found may not be on disk yet"
