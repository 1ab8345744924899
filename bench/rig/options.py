"""Values of the benches' options, and the end of a bench: one sentence instead of a traceback."""

import argparse
import math
import os
import subprocess
import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path

EXIT_FAILED, EXIT_INTERRUPTED = 1, 130


def number(holds: Callable[[float], bool], wanted: str) -> Callable[[str], float]:
    """Return a type of options: a finite number that fulfils a condition.

    Args:
        holds: the condition.
        wanted: the condition in words, such as "from 0 to 100".
    """

    def read(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value) or not holds(value):
            raise argparse.ArgumentTypeError(f"must be a number {wanted}, not {text!r}")
        return value

    return read


percent = number(lambda value: 0.0 <= value <= 100.0, "from 0 to 100")
at_least_zero = number(lambda value: value >= 0.0, "of at least 0")
positive = number(lambda value: value > 0.0, "greater than 0")


def seed(text: str) -> int:
    """Return the seed of a random number generator.

    Raises:
        ArgumentTypeError: it is not a whole number of at least 0.
    """
    return _whole_number(text, 0)


def seeds(text: str) -> range:
    """Return the seeds from FIRST to LAST - 1 of a text FIRST-LAST; one seed if there is no LAST.

    Raises:
        ArgumentTypeError: it is neither.
    """
    first, dash, last = text.partition("-")
    try:
        found = range(seed(first), seed(last) if dash else seed(first) + 1)
    except argparse.ArgumentTypeError:
        found = range(0)
    if not found:
        raise argparse.ArgumentTypeError(f"must be FIRST-LAST with FIRST < LAST, such as 0-300, not {text!r}")
    return found


def count(text: str) -> int:
    """Return a number of rounds, kills or robots.

    Raises:
        ArgumentTypeError: it is not a whole number of at least 1.
    """
    return _whole_number(text, 1)


def _whole_number(text: str, least: int) -> int:
    try:
        value = int(text)
    except ValueError:
        value = least - 1
    if value < least:
        raise argparse.ArgumentTypeError(f"must be a whole number of at least {least}, not {text!r}")
    return value


def duration_s(text: str) -> float:
    """Return a duration [s].

    Raises:
        ArgumentTypeError: it is not positive and finite.
    """
    try:
        seconds = float(text)
    except ValueError:
        seconds = math.nan
    if not 0.0 < seconds < math.inf:
        raise argparse.ArgumentTypeError(f"must be a positive number of seconds, not {text!r}")
    return seconds


def output_file(text: str) -> Path:
    """Return the path of a file that can be written, so that no long run ends without its results.

    Raises:
        ArgumentTypeError: it cannot be written.
    """
    path = Path(text)
    if path.is_dir():
        raise argparse.ArgumentTypeError(f"{text!r} is a directory")
    if not path.parent.is_dir():
        raise argparse.ArgumentTypeError(f"there is no directory {str(path.parent)!r}")
    if not os.access(path if path.exists() else path.parent, os.W_OK):
        raise argparse.ArgumentTypeError(f"{text!r} cannot be written")
    return path


@contextmanager
def failing_in_a_sentence(bench: str, written: str = "nothing was written") -> Generator[None]:
    """End the program with one sentence if a process of the bench fails, or on Ctrl-C.

    Args:
        bench: its name.
        written: what an interrupted run has stored.
    """
    try:
        yield
    except KeyboardInterrupt:
        print(f"{bench}: interrupted; {written}", file=sys.stderr)
        sys.exit(EXIT_INTERRUPTED)
    except (RuntimeError, OSError, subprocess.SubprocessError) as error:
        print(f"{bench}: {str(error) or type(error).__name__}", file=sys.stderr)
        sys.exit(EXIT_FAILED)
