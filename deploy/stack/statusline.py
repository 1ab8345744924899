"""A status line that is updated in place on a terminal; no output elsewhere."""

import os
import sys


class StatusLine:
    """A status line on standard output; print everything else with `say`."""

    def __init__(self) -> None:
        self._on_terminal = sys.stdout.isatty() and os.environ.get("TERM", "dumb") != "dumb"
        self._shown = ""

    def show(self, line: str) -> None:
        """Replace the status line."""
        if not self._on_terminal or line == self._shown:
            return
        try:
            columns = os.get_terminal_size(sys.stdout.fileno()).columns
        except OSError:
            columns = 80
        self._shown = line
        print(f"\r\x1b[K{line[: columns - 1]}", end="", flush=True)

    def say(self, sentence: str) -> None:
        """Print a permanent line."""
        self.clear()
        print(sentence, flush=True)

    def clear(self) -> None:
        if self._shown:
            print("\r\x1b[K", end="", flush=True)
            self._shown = ""
