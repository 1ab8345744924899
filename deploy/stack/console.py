"""What a command prints: sentences, JSON, pages, and a line that is updated in place."""

import json
import os
import sys
from typing import TYPE_CHECKING, TextIO

from wire.host.installation import runnable
from wire.text import printable, printable_lines

if TYPE_CHECKING:
    from rich.console import RenderableType


def say(sentence: str) -> None:
    print(f"lifeline: {runnable(printable_lines(sentence))}", flush=True)


def note(sentence: str) -> None:
    """Report progress on standard error; standard output is for the result."""
    print(f"lifeline: {runnable(printable_lines(sentence))}", file=sys.stderr, flush=True)


def print_json(document: object) -> None:
    """Print a result as one JSON document."""
    print(json.dumps(document, indent=2), flush=True)


def answer(result: object, sentence: str, *, as_json: bool) -> None:
    """Print a result as JSON, or as a sentence."""
    if as_json:
        print_json(result)
    else:
        say(sentence)


def show(result: object, *pages: "RenderableType", as_json: bool) -> None:
    """Print a result as JSON, or as pages for the terminal."""
    if as_json:
        print_json(result)
        return
    from rich.console import Console  # noqa: PLC0415 - slow, and not needed for JSON

    Console().print(*pages)


class StatusLine:
    """A line on a stream, by default standard output, that is updated in place on a terminal, and not shown on a pipe.

    Print everything else there with `say`.
    """

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = stream or sys.stdout
        self._on_terminal = self._stream.isatty() and os.environ.get("TERM", "dumb") != "dumb"
        self._shown = ""

    def show(self, line: str) -> None:
        """Replace the status line."""
        if not self._on_terminal or line == self._shown:
            return
        try:
            columns = os.get_terminal_size(self._stream.fileno()).columns
        except OSError:
            columns = 80
        self._shown = line
        print(f"\r\x1b[K{printable(line[: columns - 1])}", end="", flush=True, file=self._stream)

    def say(self, sentence: str) -> None:
        """Print a permanent line."""
        self.clear()
        print(runnable(printable_lines(sentence)), flush=True, file=self._stream)

    def clear(self) -> None:
        if self._shown:
            print("\r\x1b[K", end="", flush=True, file=self._stream)
            self._shown = ""
