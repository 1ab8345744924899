"""A status line that is updated in place on a terminal; on a pipe, it is not shown."""

import os
import sys
from typing import TextIO


class StatusLine:
    """A status line on a stream, by default standard output; print everything else there with `say`."""

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
        print(f"\r\x1b[K{line[: columns - 1]}", end="", flush=True, file=self._stream)

    def say(self, sentence: str) -> None:
        """Print a permanent line."""
        self.clear()
        print(sentence, flush=True, file=self._stream)

    def clear(self) -> None:
        if self._shown:
            print("\r\x1b[K", end="", flush=True, file=self._stream)
            self._shown = ""
