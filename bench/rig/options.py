"""The command line of a bench: its options, their values, and its end in one sentence instead of a traceback."""

import argparse
import math
import os
import subprocess
import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TypeVar

from bench.rig.load import look
from deploy.stack.errors import DeployError, Interrupted, interrupts

EXIT_FAILED = 1

N = TypeVar("N", int, float)


class CommandLine:
    """The options of `python -m MODULE`, and the command that repeats a run with them.

    Args:
        module: the module of the bench.
        description: what it measures.
        epilog: the exit codes.
    """

    def __init__(self, module: str, description: str, epilog: str) -> None:
        self.module = module
        self.parser = argparse.ArgumentParser(
            prog=f"python -m {module}", description=description, epilog=epilog
        )
        self._names: list[str] = []

    def option(
        self, name: str, read: Callable[[str], object], default: object, text: str, *, many: bool = False
    ) -> None:
        """Add an option with a value, or with several.

        Args:
            name: the name of the option, without dashes.
            read: returns a value, or raises ArgumentTypeError or ValueError.
            default: None: the text describes it.
            text: the help, as an imperative or a noun.
            many: whether it takes several values.
        """
        self._names.append(name)
        shown = "" if default is None else f" (default: {_words(default)})"
        self.parser.add_argument(
            f"--{name}",
            type=read,
            nargs="+" if many else None,
            default=default,
            metavar="N",
            help=f"{text}{shown}",
        )

    def flag(self, name: str, text: str) -> None:
        """Add an option without a value."""
        self._names.append(name)
        self.parser.add_argument(f"--{name}", action="store_true", default=None, help=text)

    def file(self, name: str, text: str) -> None:
        """Add the option for a file that the bench writes; it is not a part of the command that repeats the run."""
        self.parser.add_argument(f"--{name}", type=output_file, metavar="FILE", help=text)

    def parse(self) -> argparse.Namespace:
        return self.parser.parse_args()

    def repeat(self, options: argparse.Namespace) -> str:
        """Return the command that repeats a run, with its defaults, which may change; without options that are None."""
        words = [f"python -m {self.module}"]
        for name in self._names:
            value = getattr(options, name.replace("-", "_"))
            if value is not None:
                words.append(f"--{name}" if value is True else f"--{name} {_words(value)}")
        return " ".join(words)


def _words(value: object) -> str:
    values: list[object] = value if isinstance(value, list) else [value]  # pyright: ignore[reportUnknownVariableType]
    return " ".join(f"{one:g}" if isinstance(one, float) else str(one) for one in values)


def progress(text: str) -> None:
    """Report the progress of a bench, beside its results, and note the load of the machine."""
    look()
    print(text, file=sys.stderr, flush=True)


def number(kind: Callable[[str], N], holds: Callable[[N], bool], wanted: str) -> Callable[[str], N]:
    """Return a type of options: a finite number that fulfils a condition.

    Args:
        kind: int or float.
        holds: the condition.
        wanted: the condition in words, such as "number from 0 to 100".
    """

    def read(text: str) -> N:
        with suppress(ValueError):
            value = kind(text)
            if math.isfinite(value) and holds(value):
                return value
        raise argparse.ArgumentTypeError(f"must be a {wanted}, not {text!r}")

    return read


percent = number(float, lambda value: 0.0 <= value <= 100.0, "number from 0 to 100")
at_least_zero = number(float, lambda value: value >= 0.0, "number of at least 0")
positive = number(float, lambda value: value > 0.0, "number greater than 0")
seed = number(int, lambda value: value >= 0, "whole number of at least 0")
"""Type of an option: the seed of a random number generator."""
count = number(int, lambda value: value >= 1, "whole number of at least 1")
"""Type of an option: a number of rounds, kills or robots."""


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
    """End the program with one sentence if a process of the bench fails, or at a signal, after all contexts have been left.

    Args:
        bench: its name.
        written: what an interrupted run has stored.
    """
    try:
        with interrupts():
            yield
    except Interrupted as error:
        print(f"{bench}: interrupted; {written}", file=sys.stderr)
        sys.exit(error.exit_code)
    except (RuntimeError, OSError, subprocess.SubprocessError, DeployError) as error:
        print(f"{bench}: {str(error) or type(error).__name__}", file=sys.stderr)
        sys.exit(EXIT_FAILED)
