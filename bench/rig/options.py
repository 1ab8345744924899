"""Values of the benches' options, and the end of a bench: one sentence instead of a traceback."""

import argparse
import math
import os
import subprocess
import sys
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

EXIT_FAILED, EXIT_INTERRUPTED = 1, 130


def count(text: str) -> int:
    """Return a number of rounds, kills or robots.

    Raises:
        ArgumentTypeError: it is not a whole number of at least 1.
    """
    try:
        number = int(text)
    except ValueError:
        number = 0
    if number < 1:
        raise argparse.ArgumentTypeError(f"must be a whole number of at least 1, not {text!r}")
    return number


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
def failing_in_a_sentence(bench: str) -> Generator[None]:
    """End the program with one sentence if a process of the bench fails, or on Ctrl-C."""
    try:
        yield
    except KeyboardInterrupt:
        print(f"{bench}: interrupted; nothing was written", file=sys.stderr)
        sys.exit(EXIT_INTERRUPTED)
    except (RuntimeError, OSError, subprocess.SubprocessError) as error:
        print(f"{bench}: {str(error) or type(error).__name__}", file=sys.stderr)
        sys.exit(EXIT_FAILED)
