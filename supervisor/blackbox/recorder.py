"""The black box: writes the last minute of the law's inputs and decisions to a file at every stop.

Every step is packed into bytes immediately, which takes some microseconds. Each second begins with the law's state,
so that a replay can start at any second and is bit-exact. The memory is bounded by time and by bytes, and therefore
also by count: no step is smaller than `STEP_OVERHEAD_BYTES`.

A stop is a new reason of the owner of the wheels while the robot may move. A second reason counts as well, such as a
base that runs away after it was stopped. A reason at rest writes no file.
The file is written `TAIL_S` later, so that it shows the braking. An error in the black box is logged once, and
supervision continues.
"""

import logging
import platform
import queue
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from supervisor.blackbox.file import LAW, Order, Steps, pack_state, pack_step, write
from supervisor.blackbox.people import People
from supervisor.law.base_motion import moves
from supervisor.law.decision import Decision, Mode
from supervisor.law.model import Inputs, LawConfig
from supervisor.law.reckoning import STANDSTILL
from supervisor.law.state import State
from wire.host.config import absolute
from wire.reasons import SEVERITY, StopReason
from wire.topics import SCAN

_log = logging.getLogger(__name__)

TAIL_S = 2.0
"""Recorded time after a stop; a new stop within this time goes to the same file."""
TAIL_LIMIT_S = 10.0
"""Maximum time from the first of several such stops to the writing of the file."""
CONFIRMED_S = 0.3
"""A stop is confirmed within this time: by the next scan of a slow lidar."""
SEGMENT_S = 1.0
SEGMENT_BYTES = 1 << 20
MEMORY_BYTES = 12 << 20
"""60 s of scans with 360 beams take 5 MB; with a message flood or a far larger lidar, less than 60 s are kept."""
FILE_BYTES = 20_000_000
STEP_OVERHEAD_BYTES = 48
"""Overhead of a bytes object and its list entry, until its second ends."""

QUEUE_DEPTH = 2
PAUSE_S = 0.0002
"""Pause after each line; a file of 60 s takes about 3 s."""
CLOSE_LIMIT_S = 1.0


class Writer(Protocol):
    """Interface of a black box writer; no call blocks for long."""

    def submit(self, order: Order) -> None: ...

    def close(self) -> None:
        """Write everything that was submitted."""
        ...


class StepRecorder(Protocol):
    """Interface of what records the steps of a supervisor; no call blocks for long."""

    def record(self, now_s: float, inputs: Inputs, state: State, decision: Decision) -> None: ...

    def close(self) -> None: ...


@dataclass(slots=True)
class _Segment:
    first_s: float
    state: bytes
    growing: list[bytes] = field(default_factory=list[bytes])
    """Its packed steps, until the segment ends."""
    last_s: float = 0.0
    size: int = 0
    _ended: Steps | None = None

    def end(self) -> None:
        self._ended, self.growing = Steps(self.growing), []

    @property
    def steps(self) -> Steps:
        return Steps(self.growing) if self._ended is None else self._ended


@dataclass(slots=True)
class _Stop:
    """A stop whose tail is still being recorded."""

    moment: str
    """UTC time of the first stop, as in the file's name."""
    first_s: float
    due_s: float
    stops: list[dict[str, Any]]
    room: int
    """Bytes that the tail may take before the oldest part of its file must be dropped."""

    @property
    def most_severe(self) -> StopReason:
        return min((reason for entry in self.stops for reason in entry["reasons"]), key=SEVERITY.__getitem__)


class BlackBox:
    """Records the steps of one supervisor. All methods are called on its event loop."""

    def __init__(
        self,
        law: LawConfig,
        writer: Writer,
        *,
        window_s: float,
        lidar_topics: Sequence[str] = (SCAN.key,),
        utc: Callable[[], float] = time.time,
        people: People | None = None,
    ) -> None:
        self._people = People() if people is None else people
        self._law = LAW.spell(LAW.pack(law))
        self._lidar_topics = list(lidar_topics)
        self._writer = writer
        self._window_s = window_s
        self._utc = utc
        self._segments: deque[_Segment] = deque()
        self.size = 0
        """Size of the recording in memory, in bytes."""
        self._cut: deque[tuple[float, int]] = deque()
        """For each segment dropped for lack of memory: its last time and its number of steps."""
        self._free = False
        """Whether the last decision was not STOPPED."""
        self._without_owner: frozenset[StopReason] = frozenset()
        """The reasons of the last step without an owner of the wheels."""
        self._stop: _Stop | None = None
        self._broken = False

    def record(self, now_s: float, inputs: Inputs, state: State, decision: Decision) -> None:
        """Record one step; never raises.

        Args:
            now_s: the time of the step.
            inputs: the inputs of the step.
            state: the state before the step.
            decision: the decision of the step.
        """
        if self._broken:
            return
        try:
            self._record(now_s, inputs, state, decision)
        except Exception:  # noqa: BLE001 - a recorder must not stop what it records
            self._broken = True
            self._segments.clear()
            _log.exception("the black box has stopped recording; supervision continues")

    def close(self) -> None:
        """Write a pending file without waiting for the rest of its tail; takes about a second at most."""
        if self._stop is not None and not self._broken:
            self._submit(self._stop)
        self._writer.close()

    def _record(self, now_s: float, inputs: Inputs, state: State, decision: Decision) -> None:
        segment = self._segments[-1] if self._segments else None
        if segment is None or now_s - segment.first_s >= SEGMENT_S or segment.size >= SEGMENT_BYTES:
            segment = self._begin(now_s, state)
        step = pack_step(now_s, inputs, decision)
        segment.growing.append(step)
        segment.last_s = now_s
        self._grow(segment, len(step) + STEP_OVERHEAD_BYTES)
        self._drop_oldest(now_s)

        was_free, self._free = self._free, decision.mode is not Mode.STOPPED
        new = frozenset(decision.reasons) - self._known(state, decision)
        if new and (_may_move(state, inputs) or _has_just_stopped(state, now_s)):
            self._on_stop(now_s, [reason for reason in decision.reasons if reason in new], was_free=was_free)
        if self._stop is not None and (now_s >= self._stop.due_s or self._stop.room <= 0):
            self._submit(self._stop)

    def _known(self, state: State, decision: Decision) -> frozenset[StopReason]:
        """Return the reasons that the owner of the wheels had before this step, even if it was not the owner then."""
        owner = next((s for s in state.interlock.sources if s.config.name == decision.owner), None)
        if owner is not None:
            return owner.latched
        known, self._without_owner = self._without_owner, frozenset(decision.reasons)
        return known

    def _begin(self, now_s: float, state: State) -> _Segment:
        """Begin a new segment."""
        if self._segments:
            self._segments[-1].end()
        segment = _Segment(now_s, pack_state(state))
        self._segments.append(segment)
        self._grow(segment, len(segment.state) + STEP_OVERHEAD_BYTES)
        return segment

    def _drop_oldest(self, now_s: float) -> None:
        """Drop segments that are older than the window or exceed the memory limit, but never the newest."""
        horizon_s = (now_s if self._stop is None else self._stop.first_s) - self._window_s
        while len(self._segments) > 1:
            is_old = self._segments[1].first_s <= horizon_s
            if not is_old and self.size <= MEMORY_BYTES:
                break
            oldest = self._segments.popleft()
            self.size -= oldest.size
            if not is_old:
                self._cut.append((oldest.last_s, len(oldest.steps)))
        while self._cut and self._cut[0][0] <= horizon_s:
            self._cut.popleft()

    def _grow(self, segment: _Segment, size: int) -> None:
        segment.size += size
        self.size += size
        if self._stop is not None:
            self._stop.room -= size

    def _on_stop(self, now_s: float, reasons: Sequence[StopReason], *, was_free: bool) -> None:
        moment = datetime.fromtimestamp(self._utc(), UTC)
        entry = {
            "now_s": now_s,
            "utc": moment.isoformat(timespec="milliseconds"),
            "reasons": [reason.name for reason in reasons],
        }
        if self._stop is not None:
            # A consequence of a more severe reason, such as the silence of a dead source, needs no file of its own.
            if was_free or SEVERITY[reasons[0]] < SEVERITY[self._stop.most_severe]:
                self._stop.due_s = min(now_s + TAIL_S, self._stop.first_s + TAIL_LIMIT_S)
            self._stop.stops.append(entry)
            return
        name = f"{moment:%Y%m%dT%H%M%S}.{moment.microsecond // 1000:03}Z"
        self._stop = _Stop(name, now_s, now_s + TAIL_S, [entry], MEMORY_BYTES // 2)

    def _submit(self, stop: _Stop) -> None:
        self._stop = None
        header: dict[str, Any] = {
            "stops": stop.stops,
            "window_s": self._window_s,
            "tail_s": TAIL_S,
            "last_s": self._segments[-1].last_s,
            "left_out_for_memory": sum(count for _, count in self._cut),
            "python": platform.python_version(),
            "numpy": np.__version__,
            "machine": platform.machine(),
            "lidar_topics": self._lidar_topics,
            "people": self._people.acts,
            "config": self._law,
        }
        segments = [(s.state, s.steps) for s in self._segments]
        self._writer.submit(Order(f"{stop.moment}-{stop.most_severe}", header, segments))


def _has_just_stopped(state: State, now_s: float) -> bool:
    """Return whether a robot that has moved was commanded to stop a moment ago: an obstacle is confirmed by the scan after that."""
    stopped_s = state.base.stopped_s
    return state.base.way_m > 0.0 and stopped_s is not None and now_s - stopped_s < CONFIRMED_S


def _may_move(state: State, inputs: Inputs) -> bool:
    """Return whether the robot is commanded to move, moves according to odometry, or may still be braking."""
    velocities = [state.base.odometer.velocity, state.base.following.most]
    if inputs.odometry is not None:
        velocities.append(inputs.odometry.velocity)
    return state.base.output != STANDSTILL or any(
        moves(velocity, state.config.residual) for velocity in velocities
    )


class ThreadWriter:
    """Writes black boxes on a thread that pauses after each line, so that a tick waits for one line at most.

    A separate process delays ticks more: docs/decisions/0011.
    """

    def __init__(self, directory: Path, *, max_files: int, max_bytes: int = FILE_BYTES) -> None:
        self._directory = absolute(directory)
        self._max_files = max_files
        self._max_bytes = max_bytes
        self._orders: queue.Queue[Order] = queue.Queue(QUEUE_DEPTH)
        self._hurry = threading.Event()
        self._thread: threading.Thread | None = None
        self._warned = False

    def submit(self, order: Order) -> None:
        try:
            self._orders.put_nowait(order)
        except queue.Full:
            self._warn(f"{order.name} is not written, because two others are still waiting")
            return
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="black box", daemon=True)
            self._thread.start()

    def close(self) -> None:
        """Write the remaining files without pauses, for at most `CLOSE_LIMIT_S`."""
        self._hurry.set()
        with self._orders.all_tasks_done:
            self._orders.all_tasks_done.wait_for(
                lambda: not self._orders.unfinished_tasks, timeout=CLOSE_LIMIT_S
            )

    def _run(self) -> None:
        while True:
            order = self._orders.get()
            try:
                path = write(
                    order,
                    self._directory,
                    max_files=self._max_files,
                    max_bytes=self._max_bytes,
                    pause=lambda: self._hurry.wait(PAUSE_S),
                )
            except Exception as error:  # noqa: BLE001 - supervision must continue after any error
                self._warn(str(error))
            else:
                self._warned = False
                _log.info("black box: %s", path)
            finally:
                self._orders.task_done()

    def _warn(self, sentence: str) -> None:
        """Log the problem once, until a file is written again."""
        if not self._warned:
            self._warned = True
            _log.warning("no black box: %s; supervision continues", sentence)
