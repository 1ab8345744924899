"""`lifeline demo`: measure the promises of the design from outside, on the running stack.

The real teleop runs on a pseudo-terminal and receives key presses. A separate client records cmd_vel, odometry
and status, each sample with its time of arrival. Every fault is injected while the robot moves.
"""

import asyncio
import itertools
import math
import signal
import statistics
import tempfile
import time
from collections.abc import AsyncGenerator, Callable
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from deploy.stack import bringup, interrupts, processes, takedown
from deploy.stack.errors import DeployError
from deploy.stack.keyboard import TypedTeleop, typing
from deploy.stack.launch import Launch, free_loopback_endpoint
from deploy.stack.observe import Motion, Observer, Record, State, observing
from deploy.stack.samples import Command
from deploy.stack.statedir import StateDir, locked
from deploy.stack.takedown import Say
from deploy.status import MODES
from deploy.verdict import Outcome, Verdict, judged, print_verdicts, summary, timed, worst
from wire import topics
from wire.bus import NoReplyError
from wire.messages import SafetyStatus

# The bounds in section 4 of the design, with the numbers of its sections 2 and 3.
KILL_BOUND_S = 0.010
COMMAND_TIMEOUT_S = 0.2
SCAN_TIMEOUT_S = 0.25
TICK_S = 0.02
STOP_DISTANCE_M = 0.30
STOP_TOLERANCE_M = 0.01
MAX_LINEAR_M_S, MAX_ANGULAR_RAD_S = 1.0, 2.0

TRUSTED_BRAKING_M_S2 = 1.5
BASE_REACTION_S = 0.03

STATUS_LEEWAY_S = 0.05
"""Tolerance, because a command and the status that explains it are two messages."""
HULL_RADIUS_M = 0.25

SPEED_M_S = 0.5
"""A fault is injected only above this speed."""
KEYS_TO_SPEED = "w" * 6
FULL_SPEED = "w" * 10
BACK_OUT = "s" + "x" * 3

PLAY_LIMIT_S = 120.0
"""Limit for the whole demo once sim and supervisor run; it usually takes about a quarter of this."""
CONNECT_LIMIT_S = 5.0
READY_LIMIT_S = 10.0
MOVE_LIMIT_S = 5.0
DRIVE_TRIES = 3
"""Attempts to reach speed: a busy machine may delay a process so long that the robot stops."""
STOP_LIMIT_S = 3.0
RACK_LIMIT_S = 20.0
RESTART_LIMIT_S = 12.0
QUIET_S = 0.6
"""How long the demo checks that nothing moves."""
QUIET_M = 0.002
"""How far a robot at rest may appear to move."""
STILL_SAMPLES = 10
"""Odometry at rest for 0.2 s: a standstill, not a change of direction."""


Condition = Callable[[Record], bool]


class StoryError(DeployError):
    """The demo cannot continue: a precondition of a measurement was not met."""


@dataclass(frozen=True, slots=True)
class Stop:
    """A stop, measured from the fault to standstill."""

    speed_m_s: float
    to_zero_s: float
    to_standstill_s: float
    distance_m: float


def play(say: Say, *, quick: bool, viewer: bool) -> int:
    """Start a separate robot, run the demo, and stop the robot; return 0 if no promise was broken, else 1.

    Raises:
        DeployError: the robot could not be started.
    """
    verdicts: list[Verdict] = []
    broken_off: StoryError | None = None
    with tempfile.TemporaryDirectory(prefix="lifeline-demo-", ignore_cleanup_errors=True) as directory:
        state = StateDir(Path(directory).resolve())
        state.create()
        window = "--viewer" if viewer else "--no-viewer"
        launch = Launch.read(None, free_loopback_endpoint(), sim_options=window)
        with interrupts.interrupts(), locked(state, "demo"):
            try:
                try:
                    say("starting sim and supervisor")
                    bringup.start(state, launch, say)
                    asyncio.run(_play(state, launch, say, verdicts, repetitions=3 if quick else 5))
                except StoryError as error:
                    broken_off = error
                finally:
                    interrupts.ignore()
            finally:
                with suppress(OSError):
                    say("stopping everything")
                takedown.stop(state)
    if verdicts:
        print_verdicts(verdicts)
    if broken_off is not None:
        say(f"aborted: {broken_off}")
        return 1
    say(summary(verdicts))
    return int(any(v.outcome is Outcome.BROKEN for v in verdicts))


async def _play(
    state: StateDir, launch: Launch, say: Say, verdicts: list[Verdict], *, repetitions: int
) -> None:
    """Run every part of the demo, and append the measurements to `verdicts`."""
    await bringup.wait_until_alive(state, launch, say)
    try:
        async with asyncio.timeout(PLAY_LIMIT_S), observing(launch.bus, CONNECT_LIMIT_S) as observer:
            stage = _Stage(state, launch, observer, say)
            await stage.expect(
                lambda seen: bool(seen.commands and seen.motions and seen.states),
                CONNECT_LIMIT_S,
                "cmd_vel, odometry and status did not all arrive",
            )
            verdicts += await _teleop_killed(stage, repetitions)
            for chapter in (_teleop_hung, _supervisor_killed, _scan_gone, _rack_ahead):
                verdicts += await chapter(stage)
            verdicts.append(_always(observer.take()))
    except TimeoutError as error:
        raise StoryError(f"the demo did not finish within {PLAY_LIMIT_S:g} s") from error


class _Stage:
    """The robot, its operators, and its observer."""

    def __init__(self, state: StateDir, launch: Launch, observer: Observer, say: Say) -> None:
        self.state, self.launch, self.observer, self.say = state, launch, observer, say

    @asynccontextmanager
    async def operator(self) -> AsyncGenerator[TypedTeleop]:
        """Run a teleop, and yield it once the supervisor is READY."""
        async with typing(self.launch, {processes.MARK: str(self.state.path)}) as teleop:
            began_s = time.monotonic()
            await self.expect(
                lambda seen: any(s.status.mode == SafetyStatus.READY for s in seen.states_since(began_s)),
                READY_LIMIT_S,
                "the supervisor did not become ready for a new teleop",
                teleop,
            )
            yield teleop

    async def expect(
        self, condition: Condition, limit_s: float, complaint: str, teleop: TypedTeleop | None = None
    ) -> None:
        """Wait for a precondition of a measurement.

        Raises:
            StoryError: it was not met within `limit_s`.
        """
        if await self.observer.until(condition, limit_s):
            return
        seen = self.observer.seen
        now = seen.states[-1].status if seen.states else None
        reasons = f" (it is {MODES[now.mode]}: {now.why() or 'no stop reason'})" if now else ""
        ended = (
            f"; teleop has ended: {teleop.last_lines}" if teleop is not None and not teleop.running else ""
        )
        raise StoryError(f"{complaint} within {limit_s:g} s{reasons}{ended}")

    async def accelerate(self, teleop: TypedTeleop, keys: str = KEYS_TO_SPEED) -> None:
        """Press keys, and wait until the robot reaches their speed and exceeds `SPEED_M_S`."""
        for left in reversed(range(DRIVE_TRIES)):
            try:
                await self._accelerate_once(teleop, keys)
            except StoryError as error:
                if not left or not teleop.running:
                    raise
                self.say(f"  {error}; driving again")
                await self.let_go(teleop)
            else:
                return

    async def _accelerate_once(self, teleop: TypedTeleop, keys: str) -> None:
        began_s = time.monotonic()
        teleop.press(keys)
        wanted_m_s = 0.1 * keys.count("w")

        def is_fast(seen: Record) -> bool:
            latest = seen.motions[-1]
            return latest.arrival_s > began_s and latest.linear_m_s > max(SPEED_M_S, 0.97 * wanted_m_s)

        await self.expect(is_fast, MOVE_LIMIT_S, f"the robot did not reach {wanted_m_s:.1f} m/s", teleop)

    async def let_go(self, teleop: TypedTeleop) -> None:
        """Command zero velocity, and wait until the supervisor is READY."""
        let_go_s = time.monotonic()
        teleop.press("s")
        await self.expect(
            lambda seen: any(s.status.mode == SafetyStatus.READY for s in seen.states_since(let_go_s)),
            READY_LIMIT_S,
            "the robot did not become ready after neutral",
            teleop,
        )

    async def back_to_start(self) -> None:
        """Reset the sim, which puts the robot at rest with at least 4 m of free aisle ahead."""
        try:
            response = await self.observer.bus.call(topics.SIM_RESET, timeout_s=2.0)
        except NoReplyError as error:
            raise StoryError(f"the sim did not reset: {error}") from error
        if not response.success:
            raise StoryError(f"the sim did not reset: {response.message}")
        reset_s = time.monotonic()
        await self.expect(
            lambda seen: seen.motions[-1].arrival_s > reset_s and seen.motions[-1].is_still,
            STOP_LIMIT_S,
            "the robot was not at rest after its reset",
        )

    async def standstill(self, since_s: float, limit_s: float = STOP_LIMIT_S) -> Motion:
        """Wait for a lasting standstill, and return its first odometry sample."""
        await self.expect(lambda seen: _rest(seen, since_s) is not None, limit_s, "the robot did not stop")
        rest = _rest(self.observer.seen, since_s)
        assert rest is not None
        return rest

    async def zero_since(self, fault_s: float) -> Command:
        """Wait for the first zero command on cmd_vel since the fault, and return it."""
        await self.expect(
            lambda seen: any(c.is_zero for c in seen.commands_since(fault_s)),
            STOP_LIMIT_S,
            "no zero command arrived on cmd_vel",
        )
        return next(c for c in self.observer.seen.commands_since(fault_s) if c.is_zero)

    def signal_node(self, node: str, number: signal.Signals) -> float:
        """Signal the sim or the supervisor; return the time just before."""
        found = processes.of(self.state.path)
        now_s = time.monotonic()
        for process in found:
            if process.name == node:
                processes.send(process, self.state.path, number)
        return now_s

    async def stop_after(self, teleop: TypedTeleop, number: signal.Signals) -> Stop:
        """Signal teleop while the robot drives, and measure the stop."""
        before = self.observer.take().motions[-1]
        fault_s = teleop.send(number)
        zero = await self.zero_since(fault_s)
        rest = await self.standstill(zero.arrival_s)
        return Stop(
            speed_m_s=before.linear_m_s,
            to_zero_s=zero.arrival_s - fault_s,
            to_standstill_s=rest.arrival_s - fault_s,
            distance_m=math.dist(before.position_at(fault_s), (rest.x_m, rest.y_m)),
        )

    async def nothing_moves(self) -> tuple[Outcome, str]:
        """Check for a while that nothing moves; return the outcome and what was measured."""
        since_s = await self.observer.watch(QUIET_S)
        seen = self.observer.seen
        commands, motions = list(seen.commands_since(since_s)), list(seen.motions_since(since_s))
        zeros = sum(c.is_zero for c in commands)
        quiet = 0 < len(commands) == zeros
        moved_m = (
            math.dist((motions[0].x_m, motions[0].y_m), (motions[-1].x_m, motions[-1].y_m))
            if motions
            else math.nan
        )
        return (
            judged(kept=quiet and moved_m <= QUIET_M),
            f"{zeros} of {len(commands)} commands zero in {QUIET_S:g} s, moved {moved_m * 1000:.0f} mm",
        )


def _rest(seen: Record, since_s: float) -> Motion | None:
    """Return the first sample of a lasting standstill after `since_s`, or None."""
    motions = list(seen.motions_since(since_s))
    tail = list(itertools.takewhile(lambda m: m.is_still, reversed(motions)))
    return tail[-1] if len(tail) >= STILL_SAMPLES else None


async def _teleop_killed(stage: _Stage, repetitions: int) -> list[Verdict]:
    """Kill teleop at speed repeatedly, then check that a new teleop moves nothing until it commands motion."""
    stage.say(f"killing teleop at {0.1 * len(KEYS_TO_SPEED):.1f} m/s, {repetitions} times")
    stops: list[Stop] = []
    for _ in range(repetitions):
        await stage.back_to_start()
        async with stage.operator() as teleop:
            await stage.accelerate(teleop)
            stops.append(await stage.stop_after(teleop, signal.SIGKILL))
        last = stops[-1]
        stage.say(
            f"  at {last.speed_m_s:.2f} m/s: zero after {_ms(last.to_zero_s)}, at rest after "
            f"{_ms(last.to_standstill_s)} and {_cm(last.distance_m)}"
        )
    zeros_s = [s.to_zero_s for s in stops]
    typical_s = statistics.median(zeros_s)
    farthest = max(stops, key=lambda s: s.distance_m)

    stage.say("starting teleop again")
    async with stage.operator() as teleop:
        quiet, seen = await stage.nothing_moves()
        await stage.accelerate(teleop)
        teleop.press("s")
        await stage.standstill(time.monotonic())
    return [
        Verdict(
            2,
            "teleop killed at speed: zero on cmd_vel",
            f"≤ {_ms(KILL_BOUND_S)} (median)",
            f"{_ms(typical_s)} (median of {len(stops)}; worst {_ms(max(zeros_s))})",
            worst(timed(typical_s, KILL_BOUND_S), judged(kept=max(zeros_s) < COMMAND_TIMEOUT_S)),
        ),
        Verdict(
            2,
            "… and the robot comes to rest",
            f"≤ {_cm(_braking_m(farthest.speed_m_s, KILL_BOUND_S))}",
            f"{_cm(farthest.distance_m)} in {_ms(farthest.to_standstill_s)}, from {farthest.speed_m_s:.2f} m/s (worst)",
            judged(kept=farthest.distance_m <= _braking_m(farthest.speed_m_s, KILL_BOUND_S)),
        ),
        Verdict(
            7,
            "teleop restarted: nothing moves until it is driven",
            f"zeros, ≤ {QUIET_M * 1000:.0f} mm",
            seen,
            quiet,
        ),
    ]


async def _teleop_hung(stage: _Stage) -> list[Verdict]:
    """Suspend teleop at speed (SIGSTOP), which keeps its token but ends its commands; then resume it."""
    stage.say("suspending teleop with SIGSTOP, then resuming it")
    await stage.back_to_start()
    bound_s = COMMAND_TIMEOUT_S + TICK_S
    async with stage.operator() as teleop:
        await stage.accelerate(teleop)
        stop = await stage.stop_after(teleop, signal.SIGSTOP)
        woken_s = teleop.send(signal.SIGCONT)
        await stage.expect(
            lambda seen: any(_is_heard(s) for s in seen.states_since(woken_s)),
            READY_LIMIT_S,
            "teleop did not resume",
            teleop,
        )
        quiet, seen = await stage.nothing_moves()
        await _drive_after_neutral(stage, teleop)
    return [
        Verdict(
            3,
            "teleop hung at speed: zero on cmd_vel",
            f"≤ {_ms(bound_s)}",
            f"{_ms(stop.to_zero_s)}, at rest after {_cm(stop.distance_m)}",
            timed(stop.to_zero_s, bound_s),
        ),
        Verdict(
            7,
            "teleop resumed: nothing moves until it is driven",
            f"zeros, ≤ {QUIET_M * 1000:.0f} mm",
            seen,
            quiet,
        ),
    ]


async def _supervisor_killed(stage: _Stage) -> list[Verdict]:
    """Kill the supervisor at speed: the base brakes by itself, and supervisord restarts the supervisor.

    Without the hub no message arrives; the distance is measured after the restart.
    """
    stage.say("killing the supervisor at speed")
    await stage.back_to_start()
    async with stage.operator() as teleop:
        await stage.accelerate(teleop)
        before = stage.observer.take().motions[-1]
        killed_s = stage.signal_node(topics.SUPERVISOR, signal.SIGKILL)
        await stage.expect(
            lambda seen: any(
                _is_heard(s) and _asks_for_motion(s) for s in seen.states_since(killed_s + TICK_S)
            ),
            RESTART_LIMIT_S,
            "the supervisor did not restart",
            teleop,
        )
        back_s = time.monotonic() - killed_s
        rest = await stage.standstill(killed_s + TICK_S)
        distance_m = math.dist(before.position_at(killed_s), (rest.x_m, rest.y_m))
        quiet, seen = await stage.nothing_moves()
        await _drive_after_neutral(stage, teleop)
    bound_m = _braking_m(before.linear_m_s, KILL_BOUND_S)
    return [
        Verdict(
            4,
            "supervisor killed at speed: the base brakes by itself",
            f"≤ {_cm(bound_m)}",
            f"{_cm(distance_m)}, from {before.linear_m_s:.2f} m/s",
            judged(kept=distance_m <= bound_m),
        ),
        Verdict(
            7,
            "supervisor restarted, teleop still commands motion: nothing moves",
            f"zeros, ≤ {QUIET_M * 1000:.0f} mm",
            seen,
            quiet,
        ),
        Verdict(
            8,
            "supervisor killed: drivable again after a neutral command",
            f"≤ {RESTART_LIMIT_S:g} s",
            f"{back_s:.1f} s",
            Outcome.KEPT,
        ),
    ]


async def _scan_gone(stage: _Stage) -> list[Verdict]:
    """Suspend the sim at speed (SIGSTOP), which keeps its token but ends its scans; then resume it."""
    stage.say("suspending the sim, and thus the scans, at speed")
    await stage.back_to_start()
    bound_s = SCAN_TIMEOUT_S + TICK_S
    async with stage.operator() as teleop:
        await stage.accelerate(teleop)
        gone_s = stage.signal_node(topics.SIM, signal.SIGSTOP)
        try:
            zero = await stage.zero_since(gone_s)
        finally:
            woken_s = stage.signal_node(topics.SIM, signal.SIGCONT)
        await stage.standstill(woken_s)
        await stage.expect(
            lambda seen: any(
                s.status.scan_age_s < SCAN_TIMEOUT_S for s in seen.states_since(woken_s + TICK_S)
            ),
            READY_LIMIT_S,
            "the scans did not resume",
        )
        quiet, seen = await stage.nothing_moves()
        await _drive_after_neutral(stage, teleop)
    to_zero_s = zero.arrival_s - gone_s
    return [
        Verdict(
            5,
            "scans lost at speed: zero on cmd_vel",
            f"≤ {_ms(bound_s)}",
            _ms(to_zero_s),
            timed(to_zero_s, bound_s),
        ),
        Verdict(
            7,
            "scans resumed, teleop still commands motion: nothing moves",
            f"zeros, ≤ {QUIET_M * 1000:.0f} mm",
            seen,
            quiet,
        ),
    ]


async def _rack_ahead(stage: _Stage) -> list[Verdict]:
    """Drive at full speed straight at the rack, then back out."""
    stage.say("driving at the rack ahead at 1.0 m/s")
    await stage.back_to_start()
    async with stage.operator() as teleop:
        began_s = time.monotonic()
        await stage.accelerate(teleop, FULL_SPEED)
        stage.observer.seen.nearest_beams.clear()
        rest = await stage.standstill(time.monotonic(), RACK_LIMIT_S)
        await stage.observer.watch(QUIET_S)
        seen = stage.observer.seen
        clearances_m = [s.status.nearest_m for s in seen.states_since(began_s)]
        final_m = clearances_m[-1]
        beam_m = min(seen.nearest_beams) - HULL_RADIUS_M
        top_m_s = max(m.linear_m_s for m in seen.motions_since(began_s))
        stage.say(f"  stopped {_cm(final_m)} before it, after {rest.arrival_s - began_s:.1f} s; backing out")
        least_m = min(*clearances_m, beam_m)
        turned_s = time.monotonic()
        teleop.press(BACK_OUT)
        await stage.expect(
            lambda seen: any(s.status.nearest_m > final_m + 0.2 for s in seen.states_since(turned_s)),
            MOVE_LIMIT_S,
            "the robot did not back out",
            teleop,
        )
        teleop.press("s")
        await stage.standstill(time.monotonic())
        away_m = stage.observer.seen.states[-1].status.nearest_m
    bound_m = STOP_DISTANCE_M - STOP_TOLERANCE_M
    return [
        Verdict(
            6,
            f"driven at a rack at {top_m_s:.2f} m/s: minimum clearance of the hull",
            f"≥ {_cm(bound_m)}",
            f"{_cm(least_m)}, at rest {_cm(final_m)}",
            judged(kept=least_m >= bound_m),
        ),
        Verdict(
            6, "… and it may back out", "by keys alone", f"to {_cm(away_m)}", judged(kept=away_m > final_m)
        ),
    ]


async def _drive_after_neutral(stage: _Stage, teleop: TypedTeleop) -> None:
    """Command zero velocity, then drive: this leaves every stop."""
    await stage.let_go(teleop)
    await stage.accelerate(teleop)
    teleop.press("s")
    await stage.standstill(time.monotonic())


def _is_heard(state: State) -> bool:
    """Return whether the supervisor hears a source now; the age of a source that never sent is NaN."""
    return any(source.age_s < COMMAND_TIMEOUT_S for source in state.status.sources)


def _asks_for_motion(state: State) -> bool:
    return any(not source.neutral for source in state.status.sources)


def _always(seen: Record) -> Verdict:
    """Check all recorded commands: within limits, never NaN, and zero while a stop holds."""
    worst_m_s = max(abs(c.linear_m_s) for c in seen.commands)
    worst_rad_s = max(abs(c.angular_rad_s) for c in seen.commands)
    limited = all(
        math.isfinite(c.linear_m_s + c.angular_rad_s)
        and abs(c.linear_m_s) <= MAX_LINEAR_M_S
        and abs(c.angular_rad_s) <= MAX_ANGULAR_RAD_S
        for c in seen.commands
    )
    while_stopped = 0
    for state, following in itertools.pairwise(seen.states):
        if state.is_stopped:
            window = (state.arrival_s + STATUS_LEEWAY_S, following.arrival_s - STATUS_LEEWAY_S)
            while_stopped += sum(window[0] < c.arrival_s < window[1] and not c.is_zero for c in seen.commands)
    return Verdict(
        1,
        "cmd_vel within its limits, and zero while a stop reason holds",
        f"{MAX_LINEAR_M_S:g} m/s, {MAX_ANGULAR_RAD_S:g} rad/s",
        f"{worst_m_s:.2f} m/s, {worst_rad_s:.2f} rad/s; {while_stopped} of {len(seen.commands)} commands non-zero during a stop",
        judged(kept=limited and while_stopped == 0),
    )


def _braking_m(speed_m_s: float, reaction_s: float) -> float:
    return speed_m_s * (reaction_s + BASE_REACTION_S) + speed_m_s**2 / (2 * TRUSTED_BRAKING_M_S2)


def _ms(duration_s: float) -> str:
    milliseconds = duration_s * 1000
    return f"{milliseconds:.1f} ms" if milliseconds < 100 else f"{milliseconds:.0f} ms"


def _cm(distance_m: float) -> str:
    return f"{distance_m * 100:.1f} cm"
