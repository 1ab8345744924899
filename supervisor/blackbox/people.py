"""What people did, for the black box: who drove, asked, handed over, pressed the e-stop and reset it, as their programs report it.

The supervisor calls the services `<source>/holder` of the command sources after each change: one call of each at a time, and
at most one in `PERIOD_S`. The answers are foreign text, and no input of the law.
"""

import asyncio
import time
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from datetime import UTC, datetime

from wire import topics
from wire.bus import Bus, NoReplyError
from wire.text import printable

MAX_ACTS = 32
"""A black box holds the newest ones, also those before its window. One too many displaces the oldest of the source or service
with the most."""
MAX_LENGTH = 500
"""Characters of one."""
SERVICES = ("e-stop", "reset")
"""What the supervisor itself notes, beside the answers of the sources."""
ANSWER_LIMIT_S = 1.0
PERIOD_S = 0.5


class People:
    """The newest acts of people.

    Args:
        utc: returns the wall time [s].
    """

    def __init__(self, utc: Callable[[], float] = time.time) -> None:
        self._utc = utc
        self._acts: list[dict[str, str]] = []
        self._asking: asyncio.Task[None] | None = None
        self._is_due = False

    @property
    def acts(self) -> list[dict[str, str]]:
        """The acts in order of time, each with its time `utc`, `by` (a source or a service), and `text`."""
        return list(self._acts)

    def note(self, by: str, text: str) -> None:
        """Keep an act, unless it repeats the newest one of the same source; a press ends what a reset repeats, and the reverse."""
        text = printable(text[:MAX_LENGTH])
        kind = SERVICES if by in SERVICES else (by,)
        newest = next((act for act in reversed(self._acts) if act["by"] in kind), None)
        if newest is None or (newest["by"], newest["text"]) != (by, text):
            utc = datetime.fromtimestamp(self._utc(), UTC).isoformat(timespec="milliseconds")
            self._acts.append({"utc": utc, "by": by, "text": text})
        if len(self._acts) > MAX_ACTS:
            crowd = Counter(act["by"] for act in self._acts).most_common(1)[0][0]
            self._acts.remove(next(act for act in self._acts if act["by"] == crowd))

    def ask(self, bus: Bus, sources: Sequence[str]) -> None:
        """Ask the programs behind these sources soon what people did; never blocks."""
        self._is_due = True
        if self._asking is None:
            self._asking = asyncio.get_running_loop().create_task(self._ask(bus, sources))

    async def _ask(self, bus: Bus, sources: Sequence[str]) -> None:
        try:
            while self._is_due:
                self._is_due = False
                # At the same time: a silent program delays no other.
                await asyncio.gather(*(self._ask_one(bus, source) for source in sources))
                await asyncio.sleep(PERIOD_S)
        finally:
            self._asking = None

    async def _ask_one(self, bus: Bus, source: str) -> None:
        with suppress(NoReplyError):
            answer = await bus.call(topics.source_holder(source), timeout_s=ANSWER_LIMIT_S)
            self.note(source, answer.message)

    def close(self) -> None:
        """Stop asking."""
        if self._asking is not None:
            self._asking.cancel()
