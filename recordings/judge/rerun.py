"""Runs the law over a recording of a robot that Lifeline did not supervise. Pure.

The robot did not obey the law. The law is therefore told at each step what the recording shows: the base was commanded
what was recorded, and after each stop the operator sends a neutral command. So the law answers at each moment: would it
have stopped the robot here, if it had driven here under the same commands? Only the first answer needs no such condition.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from recordings.judge.findings import BARRIER, CLAMPED, Moment
from supervisor.law import base as bases
from supervisor.law.base import Base
from supervisor.law.base_motion import FOLLOWING, moves
from supervisor.law.decision import Decision
from supervisor.law.model import Command, Inputs, LawConfig, SourceConfig
from supervisor.law.reckoning import STANDSTILL, Velocity
from supervisor.law.safety import initial_state, step
from supervisor.law.state import State
from supervisor.messages import to_odometry, to_scan
from wire import messages as ros
from wire.bus import Arrival
from wire.freshness import Sent, Track
from wire.reasons import StopReason
from wire.standstill import is_still

SOURCE = "recorded"
EPOCH = b"recorded"
START_S = 1000.0
"""The law's time at the beginning of the recording."""
TICK_S = 0.02
BREAK_S = 10.0
"""After a longer pause of all messages, the law starts again."""
WARM_UP_SCANS = 2.0
"""Scan timeouts after a start in which nothing is judged: a clock is proven first, and the first scans show the noise."""


class Rerun:
    """The law over one recording. Times are seconds since the beginning of the recording.

    Args:
        law: its configuration; the sources and stations are ignored, because the recording has one writer of commands.
        follows_odometry: whether the motion that odometry shows counts as commanded, because no commands are recorded.
    """

    def __init__(self, law: LawConfig, *, follows_odometry: bool = False) -> None:
        self._follows_odometry = follows_odometry
        source = SourceConfig(SOURCE, 0)
        self.law = replace(law, sources=(source,), estop_stations=())
        self.judged_from_s = math.inf
        """From when on something is judged; infinite before the first scan of each lidar."""
        self._warm_s = WARM_UP_SCANS * max(lidar.timeout_s for lidar in law.lidars)
        self._start(START_S)

    def advance(self, time_s: float) -> list[Moment]:
        """Run the ticks before a time, and return what the law decides."""
        now_s = START_S + time_s
        if now_s - self._last_s > BREAK_S:
            self._start(now_s)
        moments: list[Moment] = []
        while (due_s := self._last_s + TICK_S) < now_s:
            moments.append(self._step(due_s))
        return moments

    def hear_command(self, time_s: float, velocity: Velocity | None) -> Moment:
        """Process a command to the base; None: it is invalid."""
        now_s = START_S + time_s
        self._asked, self._asked_s = velocity, now_s
        return self._step(now_s, [velocity])

    def hear_scan(self, time_s: float, lidar: int, message: ros.LaserScan | None) -> Moment:
        """Process a scan of a lidar, given by its index; None: it could not be decoded."""
        now_s = max(START_S + time_s, self._last_s)
        scan = to_scan(Arrival(message, now_s, None), self.law.lidars[lidar].timeout_s, lidar)
        self._has_scan.add(lidar)
        if scan is None:
            self._inputs = replace(self._inputs, undecodable_lidars=(lidar,))
        else:
            self._inputs = replace(self._inputs, scans=(scan,))
        return self._step(now_s)

    def hear_odometry(self, time_s: float, motion: ros.Motion) -> None:
        """Process an odometry sample; the next step reads it."""
        odometry = to_odometry(Arrival(motion, max(START_S + time_s, self._last_s), None))
        if odometry is not None:
            self._moving = not is_still(*odometry.velocity)
            if self._follows_odometry and not moves(
                odometry.velocity, self.law.believable
            ):  # else it is a spike
                self._asked = odometry.velocity if self._moving else STANDSTILL
            self._inputs = replace(self._inputs, odometry=odometry, odometry_writers=(odometry.writer,))

    def _start(self, now_s: float) -> None:
        self._state = _armed(self.law, now_s)
        self._inputs = Inputs()
        self._last_s: float = now_s
        self._sequence = 0
        self._asked: Velocity | None = STANDSTILL
        """The last command; None: it is invalid."""
        self._asked_s = -math.inf
        self._moving = False
        self._has_scan = set[int]()
        self._judged_from_s = math.inf
        self._is_stopped = False
        self._last = Moment(0.0, STANDSTILL, (), (), 1.0, math.nan, math.nan, "")

    @np.errstate(all="ignore")  # hostile numbers would print warnings
    def _step(self, now_s: float, asked: Sequence[Velocity | None] = ()) -> Moment:
        now_s = max(now_s, self._last_s)
        before = self._state.base
        if self._follows_odometry:
            asked, self._asked_s = [self._asked], now_s
            before = bases.commanded(before, self._told(now_s), now_s)
            self._state = self._state._replace(base=before)
        neutral = [STANDSTILL] if self._is_stopped else []
        commands = tuple(self._command(velocity, now_s) for velocity in (*neutral, *asked))
        inputs, self._inputs = replace(self._inputs, commands=commands), Inputs()
        self._state, decision = step(self._state, now_s, inputs)
        self._last_s = now_s
        self._tell_base(before, decision, now_s)
        if math.isinf(self._judged_from_s) and len(self._has_scan) == len(self.law.lidars):
            self._judged_from_s = now_s + self._warm_s
            self.judged_from_s = min(self.judged_from_s, self._judged_from_s - START_S)
        self._is_stopped = bool(decision.reasons)
        wanted = self._wanted(now_s)
        # Otherwise the operator's neutral command is in force until the next recorded one: the last answer still holds.
        if self._is_stopped or decision.commanded != STANDSTILL or wanted == STANDSTILL:
            self._last = self._answered(decision)
        nearest = {"nearest_m": decision.nearest_m, "bearing_rad": decision.nearest_bearing_rad}
        self._last = self._last._replace(time_s=now_s - START_S, wanted=wanted, **nearest)
        return self._last

    def _command(self, velocity: Velocity | None, now_s: float) -> Command:
        self._sequence += 1
        return Command(SOURCE, velocity, now_s, Sent(EPOCH, self._sequence, now_s))

    def _tell_base(self, before: Base, decision: Decision, now_s: float) -> None:
        """Replace what the law commanded the base by what it was commanded in the recording."""
        base = self._state.base._replace(stopped_s=before.stopped_s, moving_s=before.moving_s)
        if StopReason.BASE_UNRESPONSIVE in decision.causes:  # a stop would have ended it; this base drove on
            base = base._replace(following=FOLLOWING)
        self._state = self._state._replace(base=bases.commanded(base, self._told(now_s), now_s))

    def _told(self, now_s: float) -> Velocity:
        """Return what the base was commanded: after the timeout, a base stops by itself."""
        asked = self._asked
        if asked is None:  # a base may understand what the law does not: this shows nothing about the base
            return self._state.base.measured or STANDSTILL
        is_fresh = now_s - self._asked_s <= self.law.command_timeout_s
        return asked if is_fresh and all(map(math.isfinite, asked)) else STANDSTILL

    def _wanted(self, now_s: float) -> Velocity:
        """Return the motion to be judged: the command, and the one before a silence as long as the robot moves."""
        if now_s < self._judged_from_s:
            return STANDSTILL
        if self._asked is None:
            return Velocity(math.nan, math.nan) if self._moving else STANDSTILL
        is_fresh = now_s - self._asked_s <= self.law.command_timeout_s
        return self._asked if is_fresh or self._moving else STANDSTILL

    def _answered(self, decision: Decision) -> Moment:
        """Return what the law says about the recorded motion."""
        limits, scale, asked = tuple(one.value for one in decision.causes), decision.scale, self._asked
        if decision.limit is not None:
            limits = (decision.limit.value,)
        elif not limits and scale < 1.0:
            limits = (BARRIER,)
        if asked is not None and decision.commanded not in {STANDSTILL, asked}:
            limits = (*limits, CLAMPED)
            scale *= self.law.hull_speed_m_s(decision.commanded) / self.law.hull_speed_m_s(asked)
        reasons = tuple(one.value for one in decision.reasons)
        return self._last._replace(reasons=reasons, limits=limits, scale=scale, detail=decision.detail)


def _armed(config: LawConfig, now_s: float) -> State:
    """Return a state in which the operator has sent a neutral command already: recordings may begin in motion."""
    state = initial_state(config)
    (source,) = state.interlock.sources
    source = source._replace(
        track=Track(Sent(EPOCH, 0, now_s), now_s, proven=True),
        velocity=STANDSTILL,
        sent_s=now_s,
        neutral_s=now_s,
        stamped=True,
        latched=frozenset(),
    )
    return state._replace(interlock=state.interlock._replace(sources=(source,), owner=SOURCE))
