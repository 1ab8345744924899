"""Options of the benches, and how a bench ends."""

import argparse
import signal
from collections.abc import Callable
from pathlib import Path

import pytest

from bench.rig.options import (
    EXIT_FAILED,
    CommandLine,
    at_least_zero,
    count,
    failing_in_a_sentence,
    output_file,
    percent,
    positive,
    seed,
)
from deploy.stack.errors import Interrupted
from tests.scenes.__main__ import seeds


def test_a_count_is_at_least_one() -> None:
    assert count("1") == 1
    for text in ("0", "-3", "1.5", "x", ""):
        with pytest.raises(argparse.ArgumentTypeError, match="at least 1"):
            count(text)


@pytest.mark.parametrize(
    ("read", "good", "bad"),
    [
        (percent, ["0", "2.5", "100"], ["-0.1", "100.1"]),
        (at_least_zero, ["0", "3"], ["-1e-9"]),
        (positive, ["1e-9", "0.5"], ["0", "-1"]),
    ],
)
def test_a_number_within_its_bounds_is_accepted_and_no_other(
    read: Callable[[str], float], good: list[str], bad: list[str]
) -> None:
    assert [read(text) for text in good] == [float(text) for text in good]
    for text in (*bad, "nan", "inf", "x", ""):
        with pytest.raises(argparse.ArgumentTypeError, match="must be a number"):
            read(text)


def test_seeds_are_one_number_or_a_range() -> None:
    assert (seed("0"), seeds("7"), seeds("3-5")) == (0, range(7, 8), range(3, 5))
    for text in ("-1", "x", "1.5", ""):
        with pytest.raises(argparse.ArgumentTypeError, match="of at least 0"):
            seed(text)
    for text in ("5-5", "5-1", "-3", "1-", "x"):
        with pytest.raises(argparse.ArgumentTypeError, match="FIRST < LAST"):
            seeds(text)


def test_a_new_file_and_an_old_one_are_accepted(tmp_path: Path) -> None:
    file = tmp_path / "run.jsonl"
    assert output_file(str(file)) == file
    file.write_text("")
    assert output_file(str(file)) == file


def test_a_file_that_cannot_be_written_is_refused_before_the_run(tmp_path: Path) -> None:
    with pytest.raises(argparse.ArgumentTypeError, match="is a directory"):
        output_file(str(tmp_path))
    with pytest.raises(argparse.ArgumentTypeError, match="there is no directory"):
        output_file(str(tmp_path / "none" / "run.jsonl"))


def test_the_command_that_repeats_a_run_has_its_defaults_and_no_file(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    line = CommandLine("bench.robots", "Measure robots.", "exit code: 0")
    line.option("robots", count, [1, 5], "numbers of robots", many=True)
    line.option("drive-seconds", positive, 20.0, "duration of each drive")
    line.option("soak", positive, None, "instead of the curve")
    line.flag("router", "through a router")
    line.flag("echo", "print all")
    line.file("json", "write the results")
    monkeypatch.setattr(
        "sys.argv", ["bench.robots", "--robots", "2", "3", "--router", "--json", str(tmp_path / "run.jsonl")]
    )
    assert line.repeat(line.parse()) == "python -m bench.robots --robots 2 3 --drive-seconds 20 --router"


@pytest.mark.parametrize(
    ("error", "code", "sentence"),
    [
        (Interrupted(signal.SIGINT), 130, "bench: interrupted; nothing was written\n"),
        (RuntimeError("it failed"), EXIT_FAILED, "bench: it failed\n"),
        (TimeoutError(), EXIT_FAILED, "bench: TimeoutError\n"),
    ],
)
def test_a_bench_that_fails_prints_one_sentence(
    error: BaseException, code: int, sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as end, failing_in_a_sentence("bench"):
        raise error
    assert end.value.code == code
    assert capsys.readouterr().err == sentence
