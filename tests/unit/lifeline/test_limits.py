"""A limit of the machine ends a command with one sentence: a full disk, no more threads, a terminal without Unicode."""

import errno
import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest

from wire.host.process_limits import bounded_growth, limit_of

ROOT = Path(__file__).resolve().parents[3]
CHECK = [sys.executable, "-m", "lifeline.cli.app", "check", str(ROOT / "deploy/robot.toml")]


def check(stdout: int = subprocess.PIPE, **environment: str) -> subprocess.CompletedProcess[bytes]:
    """Run a command whose output has characters beyond ASCII."""
    return subprocess.run(
        CHECK, stdout=stdout, stderr=subprocess.PIPE, env=os.environ | environment, cwd=ROOT, check=False
    )


@pytest.mark.parametrize(
    ("error", "sentence"),
    [
        (OSError(errno.ENOSPC, "x", "/a"), "/a: No space left on device: free some space"),
        (OSError(errno.EMFILE, "x"), "Too many open files: raise the limit of open files (`ulimit -n`)"),
        (RuntimeError("can't start new thread"), "Resource temporarily unavailable: end other programs"),
        (MemoryError(), "Resource temporarily unavailable: end other programs"),
        (PermissionError(errno.EACCES, "x", "/a"), "/a: Permission denied: correct its permissions"),
        (OSError(errno.ENAMETOOLONG, "x", "/a"), "/a: File name too long: give a shorter path"),
        (FileNotFoundError(errno.ENOENT, "x"), "the working directory no longer exists: change to another"),
    ],
)
def test_a_limit_is_named_with_what_to_do(error: Exception, sentence: str) -> None:
    assert (limit_of(error) or "").startswith(sentence)


@pytest.mark.parametrize(
    "error", [RuntimeError("x"), ValueError("x"), FileNotFoundError(errno.ENOENT, "x", "/a"), OSError("x")]
)
def test_another_error_is_no_limit(error: Exception) -> None:
    assert limit_of(error) is None


def test_memory_grows_and_files_become_longer_only_up_to_a_bound(tmp_path: Path) -> None:
    kinds = (resource.RLIMIT_DATA, resource.RLIMIT_FSIZE)
    before = [resource.getrlimit(kind) for kind in kinds]
    with bounded_growth(32 << 20, 1000):
        with pytest.raises(MemoryError):
            bytearray(64 << 20)
        (tmp_path / "file").write_bytes(bytes(1000))
        with pytest.raises(OSError, match="File too large"):
            (tmp_path / "longer").write_bytes(bytes(1001))
    assert [resource.getrlimit(kind) for kind in kinds] == before
    assert len(bytearray(64 << 20)) == 64 << 20


def test_a_terminal_that_shows_only_ascii_shows_a_page() -> None:
    done = check(PYTHONIOENCODING="ascii", PYTHONUTF8="0", LC_ALL="C")
    assert (done.returncode, done.stderr) == (0, b"")
    assert b"?" in done.stdout


@pytest.mark.parametrize("columns", ["0", "9" * 20])
def test_an_impossible_width_of_the_terminal_is_ignored(columns: str) -> None:
    done = check(COLUMNS=columns)
    assert (done.returncode, done.stderr) == (0, b"")
    assert b"rep117" in done.stdout


def test_a_full_disk_ends_a_command_with_one_sentence() -> None:
    full = os.open("/dev/full", os.O_WRONLY)
    try:
        done = check(stdout=full)
    finally:
        os.close(full)
    assert (done.returncode, done.stderr.count(b"\n")) == (2, 1)
    assert b"No space left on device: free some space" in done.stderr
