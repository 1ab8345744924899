"""Time breakdown of a supervisor's wake-up: each section in a loop (hot) and immediately after sleep (cold).

Times are CPU times of the thread. The cold times give the supervisor's share of a core, because it sleeps between two
ticks. Each section is measured cold on its own, while in the supervisor each section warms the caches for the next one: "a
whole tick" and "a whole scan" run their sections in sequence after one sleep.
"""

import asyncio
import math
import threading
import time
from collections.abc import Awaitable, Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from bench.law import COLD_SLEEP_S
from bench.rig.sheet import Sheet
from bench.wakeup_sections import SCAN_HZ, TICK_HZ, Prepare, prepared_sections
from wire.bus import Inbox
from wire.host.turns import Turns

ROUNDS = 70
BLOCK = 4
"""Hot runs of a section in each round; the first is not counted, because it follows another section."""
HOT_WAIT_S = 0.0005
"""Duration of the hot waits: long enough that the event loop has to wait, too short for the caches to become cold."""
REFERENCE = "reference: time.sleep"

Measure = Callable[[float], Awaitable[float]]
"""Sleeps for a time [s], 0 for none, runs the section and returns the CPU time of its thread [µs]."""


@dataclass(frozen=True)
class Section:
    """Median CPU times of one section, and how often the supervisor runs it at the robot's rates."""

    section: str
    rate_hz: float
    hot_us: float
    cold_us: float

    @property
    def cold_to_hot(self) -> float:
        return self.cold_us / self.hot_us

    @property
    def hot_percent(self) -> float:
        """Share of a core [%]."""
        return self.hot_us * self.rate_hz * 1e-4

    @property
    def cold_percent(self) -> float:
        return self.cold_us * self.rate_hz * 1e-4


def measure_wakeup(rounds: int = ROUNDS, cold_sleep_s: float = COLD_SLEEP_S) -> list[Section]:
    """Measure all sections in each round, so that load on the machine affects all of them."""
    return asyncio.run(_measure(rounds, cold_sleep_s))


async def _measure(rounds: int, cold_sleep_s: float) -> list[Section]:
    sections = _sections()
    hot: dict[str, list[float]] = {name: [] for name in sections}
    cold: dict[str, list[float]] = {name: [] for name in sections}
    for _ in range(rounds):
        for name, (_, hot_sleep_s, measure) in sections.items():
            hot[name] += [await measure(hot_sleep_s) for _ in range(BLOCK)][1:]
        for name, (_, _, measure) in sections.items():
            cold[name].append(await measure(cold_sleep_s))
    return [summarize(name, rate_hz, hot[name], cold[name]) for name, (rate_hz, _, _) in sections.items()]


def summarize(section: str, rate_hz: float, hot_us: Sequence[float], cold_us: Sequence[float]) -> Section:
    """Return a section with the medians of its times."""
    return Section(section, rate_hz, float(np.median(hot_us)), float(np.median(cold_us)))


def _sections() -> dict[str, tuple[float, float, Measure]]:
    """Return by name: the rate, the sleep before a hot run, and the measurement."""
    return {
        REFERENCE: (TICK_HZ, HOT_WAIT_S, _sleep),
        "wait for a timer": (TICK_HZ, HOT_WAIT_S, _timer_wait),
        "wake from another thread": (SCAN_HZ, HOT_WAIT_S, _thread_wake),
        **{name: (rate_hz, 0.0, _timed(prepare)) for name, (rate_hz, prepare) in prepared_sections().items()},
    }


def _timed(prepare: Prepare) -> Measure:
    async def measure(sleep_s: float) -> float:
        run = prepare()
        if sleep_s:
            time.sleep(sleep_s)  # noqa: ASYNC251 - asyncio's own wait would warm the caches
        started_ns = time.thread_time_ns()
        run()
        return _since_us(started_ns)

    return measure


async def _sleep(sleep_s: float) -> float:
    started_ns = time.thread_time_ns()
    time.sleep(sleep_s)  # noqa: ASYNC251 - the reference has no event loop
    return _since_us(started_ns)


async def _timer_wait(sleep_s: float) -> float:
    """Measure from one turn to the next one, which a timer starts."""
    loop, stop, marks_ns = asyncio.get_running_loop(), asyncio.Event(), list[int]()

    def turn() -> float:
        marks_ns.append(time.thread_time_ns())
        if len(marks_ns) == 2:
            stop.set()
        return loop.time() + sleep_s

    await Turns(turn, lambda: True).run_until(stop)
    return (marks_ns[1] - marks_ns[0]) / 1000


async def _thread_wake(sleep_s: float) -> float:
    """Measure from one turn to the next one, which an item from another thread starts; only the loop's thread counts."""
    stop, marks_ns = asyncio.Event(), list[int]()

    def turn() -> float:
        if not marks_ns:  # started earlier, the item could arrive before this turn
            threading.Timer(sleep_s, inbox.push, (1,)).start()
        elif inbox.take():
            stop.set()
        marks_ns.append(time.thread_time_ns())
        return math.inf

    turns = Turns(turn, lambda: not inbox.is_empty)
    inbox: Inbox[int] = Inbox(1, turns)
    await turns.run_until(stop)
    return (marks_ns[-1] - marks_ns[0]) / 1000


def _since_us(started_ns: int) -> float:
    return (time.thread_time_ns() - started_ns) / 1000


def wakeup_sheet(sections: Iterable[Section]) -> Sheet:
    return Sheet(
        "Sections of a supervisor's wake-up, CPU time in µs, in a loop and after sleep",
        ("section", "Hz", "hot p50", "cold p50", "cold / hot", "hot % of a core", "cold % of a core"),
        tuple(
            (
                s.section,
                f"{s.rate_hz:.0f}",
                f"{s.hot_us:.1f}",
                f"{s.cold_us:.1f}",
                f"{s.cold_to_hot:.1f}",
                f"{s.hot_percent:.2f}",
                f"{s.cold_percent:.2f}",
            )
            for s in sections
        ),
        (
            (
                f"hot: in a loop; waits of {1000 * HOT_WAIT_S:g} ms. cold: immediately after "
                f"{1000 * COLD_SLEEP_S:.0f} ms of sleep; waits of that duration. All sections alternate."
            ),
            (
                "Hz: the robot's rate; the shares of a core are the medians at that rate. free and limited are "
                "alternatives. The reference is a thread that only sleeps and wakes: the minimum for a wake-up on this machine."
            ),
            (
                "Each section alone pays for cold caches. a whole tick (odometry) and a whole scan are a sequence after one "
                "sleep: decode, step(), encode cmd_vel, record. They therefore take less than the sum of their sections."
            ),
            "decode: push into the subscription, take, and convert to the law's input. encode: with conversion and stamp.",
        ),
    )
