"""Finds the command sources that are not configured, as soon as their commands are heard."""

import re
from collections.abc import Iterable

from wire.bus import Inbox

MAX_SOURCES = 16
"""Maximum number of sources, so that invented names do not fill the memory."""
NAME = re.compile(r"[a-z][a-z0-9_]*")


class HeardSources:
    """Collects the names of command sources.

    Args:
        heard: the inbox of `Bus.hear_sources`.
        known: the sources that are already known.
    """

    def __init__(self, heard: Inbox[str], known: Iterable[str]) -> None:
        self._heard = heard
        self._known = set(known)

    def take_new(self) -> list[str]:
        """Return the sources that were heard for the first time since the last call."""
        new: list[str] = []
        for source in self._heard.take():
            if source not in self._known and len(self._known) < MAX_SOURCES and NAME.fullmatch(source):
                self._known.add(source)
                new.append(source)
        return new
