"""Runs the turns of a service: at each arrival, and at the time that the previous turn returned.

A turn runs in the callback of the event loop. A task that waits for an event would need more passes of the loop for
each turn, each with a system call.
"""

import asyncio
from collections.abc import Callable


class Turns:
    """Runs the turns of one service, and is the `wire.inbox.Wake` of its inboxes.

    Args:
        turn: runs one turn, and returns the time of the next one if nothing arrives before, by the loop's clock [s].
        has_news: returns whether something has arrived since the last turn; an earlier wake may have run the turn for it.
    """

    def __init__(self, turn: Callable[[], float], has_news: Callable[[], bool]) -> None:
        self._turn = turn
        self._has_news = has_news
        self._loop = asyncio.get_running_loop()
        self._timer: asyncio.TimerHandle | None = None
        self._runs = False
        self._failed = asyncio.Event()
        self._error: BaseException | None = None

    def set(self) -> None:
        """Run a turn, unless an earlier one has taken everything that arrived, or `run_until` is not running."""
        if self._runs and self._has_news():
            self.run_now()

    def run_now(self) -> None:
        """Run a turn, whether or not something has arrived; do nothing while `run_until` is not running."""
        if not self._runs:
            return
        try:
            due_s = self._turn()
        except BaseException as error:  # noqa: BLE001 - raised again by `run_until`; a panic in Zenoh is no Exception
            self._end()
            self._error = error
            self._failed.set()
            return
        if self._timer is not None and self._timer.when() == due_s:
            return  # the timer is already set to this time
        self._cancel_timer()
        self._timer = self._loop.call_at(due_s, self._on_time)

    async def run_until(self, stop: asyncio.Event) -> None:
        """Run a turn now, and further turns until `stop` is set.

        Raises:
            BaseException: a turn raised it.
        """
        ends = [asyncio.ensure_future(event.wait()) for event in (stop, self._failed)]
        self._runs = not stop.is_set()
        try:
            self.run_now()
            await asyncio.wait(ends, return_when=asyncio.FIRST_COMPLETED)
        finally:
            self._end()
            for end in ends:
                end.cancel()
        if self._error is not None:
            raise self._error

    def _on_time(self) -> None:
        self._timer = None
        self.run_now()

    def _end(self) -> None:
        self._runs = False
        self._cancel_timer()

    def _cancel_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
