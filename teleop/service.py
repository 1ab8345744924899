"""The asyncio shell: one loop reads the keys, sends the heartbeat and draws.

The heartbeat proves that this loop runs: a hang silences it, and the supervisor stops the robot. After a hang, missed
heartbeats are not sent later, the setpoint is zero, and keys typed during the hang are void, because the robot did
not respond to them. So are keys typed while the terminal did not show the output.
"""

import asyncio
import math
import time
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

from teleop.guards import Refusals, RoundTrip
from teleop.holder import SENDING_S, HeldError, Holder
from teleop.pilots.keys import FOCUS_OUT, NOT_TYPED, Command, KeySource, name_of
from teleop.pilots.pilot import NEUTRAL, KeyEvent, KeyKind, Pilot, Velocity, amounts
from teleop.pilots.vigilance import DEMAND_S, vigilance_left_s
from teleop.rate import TOLERANCE_S, Rate, WarningBell
from teleop.screen.controls import LEGENDS, command_for, help_lines, key_help
from teleop.screen.display import cause_in_words
from teleop.screen.view import Control, Event, Line, Robot, Tone, View, plain
from teleop.telemetry import StopNews, Telemetry
from wire import topics
from wire.bus import Bus, NoReplyError
from wire.messages import Bool, SafetyStatus, TriggerResponse, planar_twist
from wire.reasons import StopReason

DRAW_PERIOD_S = 0.1
DRAW_MARGIN_S = 0.002
"""Time before a heartbeat in which nothing is drawn."""
HANG_S = 0.15
"""A heartbeat later than this counts as a hang: at 20 Hz, the supervisor has stopped the robot by then (0.2 s)."""
SCREEN_LIMIT_S = 0.5
"""Stop the robot when the terminal has not accepted output for this long: the operator does not see the screen."""
RESET_TIMEOUT_S = 1.0
MIN_GAP_S = 0.01
"""Minimum time between two commands without a key press: a gamepad's stick sends a thousand events per second."""
IGNORED_PERIOD_S = 1.0
"""Minimum time between two notes on ignored keys."""
AT_ANY_AGE = (Command.ESTOP, Command.QUIT, Command.SUSPEND)
"""Commands of keys that count however old they are."""
KEPT_EVENTS = 50


class Screen(Protocol):
    """Interface to the output of pictures and notes."""

    @property
    def size(self) -> tuple[int, int]:
        """Number of columns and rows."""
        ...

    def show(self, lines: Sequence[Line]) -> bool:
        """Replace the displayed lines; return False if the operator cannot see them now. Never blocks."""
        ...

    def note(self, text: str) -> None:
        """Show a text that stays visible."""
        ...

    def bell(self) -> None: ...

    def doubt(self) -> None:
        """Mark keys as old until they must have been typed on a picture that is shown after this call."""
        ...

    def suspend(self) -> None:
        """Suspend the process like Ctrl-Z, with the terminal restored meanwhile; return when it continues."""
        ...


Render = Callable[[View, int, int], Sequence[Line]]
"""Renders a view with a number of columns and rows."""


@dataclass(frozen=True, slots=True)
class Setup:
    """Configuration of a teleop: name of the source, control mode and display."""

    source: str
    endpoint: str
    """Endpoint of the supervisor."""
    control: Control
    robot: Robot = Robot()
    most: Velocity = Velocity(1.0, 2.0)
    """Full scale of the velocity bars."""
    rate_hz: float = 20.0
    round_trip_limit_s: float = 0.5
    """Maximum time from a command to its confirmation; above it, the robot obeys too late, and zero is sent."""
    vigilance_s: float = 10.0
    """In control by steps: time without a key after which the screen asks for one; `DEMAND_S` later, zero is sent."""
    about: str = "teleop"
    """A sentence about this program, for other programs that want the source's name."""
    pictures: bool = True
    """Whether scans and odometry are drawn; False for the display of one line."""


class Teleop:
    """One command source on the bus with a pilot; without a pilot, a viewer.

    Args:
        bus: an open bus; the caller closes it.
        setup: name, keys and display.
        pilot: receives the keys; None: no command is sent, and no name is held.
        keys: the source of keys.
        screen: the output.
        render: renders the picture.
        wake: set by the key source, and by a pilot with other inputs, when there is input.
    """

    def __init__(
        self,
        bus: Bus,
        setup: Setup,
        *,
        pilot: Pilot | None,
        keys: KeySource,
        screen: Screen,
        render: Render,
        wake: asyncio.Event,
    ) -> None:
        self._bus, self._setup, self._pilot = bus, setup, pilot
        self._keys, self._screen, self._render, self._wake = keys, screen, render, wake
        self._telemetry = Telemetry(bus, pictures=setup.pictures)
        self._estop = bus.publisher(topics.ESTOP)
        self._cmd_vel = bus.publisher(topics.source_cmd_vel(setup.source))
        self._holder = None if pilot is None else Holder(bus, setup.source, self._cmd_vel, setup.about)
        self._events: deque[Event] = deque(maxlen=KEPT_EVENTS)
        self._bell = WarningBell()
        self._sent = NEUTRAL
        self._estop_since_s: float | None = None
        """Time of the press of SPACE, until the supervisor's status shows the e-stop."""
        self._reset: asyncio.Task[TriggerResponse] | None = None
        self._reset_until_s = -math.inf
        """Until when the newest reset may still take effect."""
        self._ignored_s = -math.inf
        """Time of the newest note on an ignored key."""
        self._key_s = -math.inf
        """Time of the newest key that counted."""
        self._demands_key = False
        self._suspending = False
        self._quitting = False
        self._has_help = False
        self._redraw = True
        self._has_rival = False
        self._has_two_supervisors = False
        self._round_trip = RoundTrip(setup.round_trip_limit_s)
        self._lateness, self._is_lateness_noted = "", False
        self._refusals, self._stops = Refusals(), StopNews()
        self._start(asyncio.get_running_loop().time())

    def _start(self, now_s: float) -> None:
        """Start the heartbeat; pictures are drawn in the middle between two heartbeats."""
        self._beat = Rate(1 / self._setup.rate_hz, now_s)
        self._draw = Rate(DRAW_PERIOD_S, now_s + 0.5 / self._setup.rate_hz)
        self._shown_s, self._published_s = now_s, -math.inf

    async def run(self, stop: asyncio.Event) -> None:
        """Drive until a quit key, the end of the keys, or `stop`; at the end, send zero and withdraw the token.

        Raises:
            HeldError: another program holds this source; the message says what to do.
            Exception: any unexpected error, including one in the task of a reset.
        """
        loop = asyncio.get_running_loop()
        stopping = loop.create_task(stop.wait())
        stopping.add_done_callback(lambda _: self._wake.set())
        try:
            while await self._claim(stop):
                self._start(loop.time())
                await self._drive(stop)
                if not self._suspending:
                    return
                await self._suspend()
        finally:
            stopping.cancel()
            if self._reset is not None:
                self._reset.cancel()
            try:
                self._let_go()
            finally:
                await self._leave()

    async def _suspend(self) -> None:
        self._let_go()
        await self._leave()
        await asyncio.sleep(SENDING_S)
        self._screen.suspend()
        self._suspending = False
        self.note("back again: the setpoint is zero")

    async def _claim(self, stop: asyncio.Event) -> bool:
        """Acquire the source's name; keys typed meanwhile can only quit. Return False if one did."""
        if self._holder is None:
            return True
        claiming = asyncio.ensure_future(self._holder.claim())
        claiming.add_done_callback(lambda _: self._wake.set())
        try:
            while not claiming.done():
                self._act(event for event in self._keys.take() if self._command(event) is not None)
                self._telemetry.look()
                if self._quitting or self._keys.ended or stop.is_set():
                    return False
                await self._wake.wait()
                self._wake.clear()
            claiming.result()
        except HeldError as error:
            raise HeldError(self._held(str(error))) from error
        finally:
            claiming.cancel()
            claiming.add_done_callback(
                lambda task: task.cancelled() or task.exception()
            )  # otherwise asyncio logs the exception as never retrieved
        return True

    def _held(self, who: str) -> str:
        self._telemetry.look()
        status, source = self._telemetry.status, self._setup.source
        free = [] if status is None else [s.name for s in status.sources if s.name != source]
        others = f" ({', '.join(plain(name) for name in free)})" if free else ""
        return (
            f"the source {source!r} is held by {plain(who)}: end that first, drive as another source of the "
            f"supervisor's with --source NAME{others}, or only watch with --view-only"
        )

    async def _leave(self) -> None:
        if self._holder is not None:
            await self._holder.leave()

    async def _drive(self, stop: asyncio.Event) -> None:
        loop = asyncio.get_running_loop()
        if self._pilot is not None:
            self._pilot.let_go()  # discard keys and sticks held before the start
        while True:
            timer = loop.call_at(self._turn(loop.time()), self._wake.set)
            try:
                if self._quitting or self._suspending or self._keys.ended or stop.is_set():
                    return
                await self._wake.wait()
            finally:
                timer.cancel()
            self._wake.clear()

    def _turn(self, now_s: float) -> float:
        """Do everything that is due; return the time of the next action."""
        events = self._keys.take()
        late_s = self._beat.lateness_s(now_s)
        if late_s > HANG_S:
            self._recover(late_s)
            events = [event._replace(is_old=True) for event in events]
        self._look(now_s)
        self._act(events)
        self._keep_vigil(now_s)
        next_s = self._move(asyncio.get_running_loop().time())
        if self._beat.tick(now_s):
            if self._published_s < now_s:  # a command that was sent in this iteration is also a heartbeat
                self._publish()
            self._repeat_estop()
        self._finish_reset()
        return min(next_s, self._beat.next_s, self._draw_if_due(now_s))

    def _recover(self, late_s: float) -> None:
        self._screen.doubt()
        if self._pilot is not None:
            self._pilot.let_go()  # sent with the heartbeat that is due
            self._sent = NEUTRAL
            self.note(f"teleop hung for {late_s:.1f} s: the setpoint is zero, keys typed meanwhile are void")

    # --- keys

    def _command(self, event: KeyEvent) -> Command | None:
        return None if event.kind is KeyKind.RELEASE else command_for(event.key, self._setup.control)

    def _act(self, events: Iterable[KeyEvent]) -> None:
        for event in events:
            is_old = event.is_old and event.kind is not KeyKind.RELEASE
            if is_old and self._command(event) not in AT_ANY_AGE:
                self._void(asyncio.get_running_loop().time())
            else:
                self._obey(event)
            if self._quitting or self._suspending:
                return  # keys typed after it are not for the robot

    def _obey(self, event: KeyEvent) -> None:
        clock = asyncio.get_running_loop().time
        command = self._command(event)
        is_known = command is not None
        if self._pilot is not None and command in (None, Command.RESET, Command.HELP):
            before, level = self._pilot.wanted(), self._pilot.level
            is_known |= self._pilot.on_key(event, clock())
            self._send(clock(), always=command is None and event.kind is KeyKind.PRESS)
            self._redraw |= before != self._pilot.wanted()
            if level != self._pilot.level:
                self._on_level(self._pilot)
        if event.kind is KeyKind.PRESS:
            self._count(event.key, clock(), is_known=is_known)
        if command is Command.HELP:
            if event.kind is KeyKind.PRESS:
                self._toggle_help()
        elif command is not None:
            self._redraw = True
            self._do(command, clock())

    def _count(self, key: str, now_s: float, *, is_known: bool) -> None:
        """Let a press renew vigilance, or note that it was ignored."""
        if not is_known:
            is_named = key in NOT_TYPED
            self._note_ignored(key if is_named else f"{plain(name_of(key))}, which has no function", now_s)
        elif key != FOCUS_OUT:
            self._key_s = now_s

    def _void(self, now_s: float) -> None:
        """Stop instead of obeying a key that may have been typed before the operator saw the present screen."""
        if self._asks_for_motion():
            self._let_go()
        self._note_ignored("a key that was typed while the screen was not seen", now_s)

    def _note_ignored(self, what: str, now_s: float) -> None:
        if now_s - self._ignored_s < IGNORED_PERIOD_S:
            return
        self._ignored_s = now_s
        self.note(f"ignored {what}{'' if self._pilot is None else ': the setpoint is zero'}", Tone.CAUTION)

    def _vigilance_left_s(self, now_s: float) -> float:
        """Return the time until zero is sent for lack of a key [s]; infinite where none is needed."""
        moving = self._setup.control is Control.INCREMENTAL and self._asks_for_motion()
        return vigilance_left_s(now_s, self._key_s, self._setup.vigilance_s, moving=moving)

    def _keep_vigil(self, now_s: float) -> None:
        """Ask for a key at the end of vigilance; without one, send zero."""
        left_s, demanded = self._vigilance_left_s(now_s), self._demands_key
        self._demands_key = left_s <= DEMAND_S
        if self._demands_key and not demanded:
            self._screen.bell()
            self.note(f"no key for {self._setup.vigilance_s:g} s: press Enter to drive on", Tone.CAUTION)
        if left_s <= 0.0:
            self._let_go()
            self._demands_key = False
            self.note("no key was pressed on demand: the setpoint is zero", Tone.STOP)
        self._redraw |= self._demands_key is not demanded

    def _do(
        self,
        command: Literal[Command.ESTOP, Command.RESET, Command.QUIT, Command.SUSPEND],
        now_s: float,
    ) -> None:
        match command:
            case Command.ESTOP:
                self._let_go()
                self._estop.put(Bool(data=True))
                if self._estop_since_s is None:
                    self.note("emergency stop", Tone.STOP)
                self._estop_since_s = now_s
                if self._reset is not None and not self._reset.done():
                    self._reset.cancel()  # a reset that is not sent yet must not follow the e-stop
                    self._reset = None
            case Command.RESET:
                self._ask_reset()
            case Command.QUIT:
                self._quitting = True
            case Command.SUSPEND:
                self._suspending = True

    def _toggle_help(self) -> None:
        """Show or hide all keys; the display of one line prints them each time."""
        if self._setup.pictures:
            self._has_help = not self._has_help
            self._redraw = True
            return
        for line in help_lines(key_help(self._setup.control)):
            self._screen.note(line)
        if self._pilot is not None:
            self._on_level(self._pilot)

    def _on_level(self, pilot: Pilot) -> None:
        """Print the speed level, if the picture does not show it."""
        self._redraw = True
        if not self._setup.pictures:
            self._screen.note(f"speed level {pilot.level}: up to {amounts(pilot.limit)}; {pilot.note}")

    # --- commands

    def _let_go(self) -> None:
        """Set the velocity to zero without a ramp, and send it immediately."""
        if self._pilot is not None:
            self._pilot.let_go()
            self._sent = NEUTRAL
            self._publish()

    def _send(self, now_s: float, *, always: bool) -> None:
        """Send the pilot's velocity if it has changed; with `always`, send it also if it stays neutral."""
        if self._pilot is None:
            return
        self._let_go_if_late(now_s)
        if self._has_two_supervisors:
            self._pilot.let_go()
        velocity = self._pilot.velocity(now_s)
        if velocity != self._sent or (always and velocity.is_neutral and self._pilot.wanted().is_neutral):
            self._sent = velocity
            self._publish()

    def _move(self, now_s: float) -> float:
        """Send the pilot's velocity if due; return the time of the next call."""
        if self._pilot is None:
            return math.inf
        velocity = self._pilot.velocity(now_s)
        may_s = self._published_s + MIN_GAP_S
        if velocity != self._sent and not velocity.is_neutral and now_s < may_s:
            return may_s
        self._send(now_s, always=False)
        return self._pilot.next_s

    def _publish(self) -> None:
        if self._holder is not None and self._holder.holds:  # before that, another program may hold the name
            now_s = self._published_s = asyncio.get_running_loop().time()
            stamp = self._cmd_vel.put(planar_twist(*self._sent))
            self._round_trip.sent(stamp.source_time_ns, now_s)

    def _repeat_estop(self) -> None:
        """Repeat the e-stop until the status shows it, because a single sample can get lost.

        A reset that was requested before may still be on its way, and the status may still show the e-stop that it ends.
        """
        if self._estop_since_s is None:
            return
        status = self._telemetry.status
        is_newer = self._telemetry.statuses.arrival_s > max(self._estop_since_s, self._reset_until_s)
        if status is not None and is_newer and "ESTOP" in status.reasons:
            self._estop_since_s = None
        else:
            self._estop.put(Bool(data=True))

    def _ask_reset(self) -> None:
        if self._reset is not None:
            return  # a reset is in progress
        self._estop_since_s = None
        loop = asyncio.get_running_loop()
        self._reset_until_s = loop.time() + RESET_TIMEOUT_S
        self._reset = loop.create_task(self._bus.call(topics.SUPERVISOR_RESET, timeout_s=RESET_TIMEOUT_S))
        self._reset.add_done_callback(lambda _: self._wake.set())

    def _finish_reset(self) -> None:
        if self._reset is None or not self._reset.done():
            return
        task, self._reset = self._reset, None
        try:
            response = task.result()
        except NoReplyError as error:
            self.note(f"reset: {plain(str(error))}", Tone.CAUTION)
        else:
            verdict, tone = ("done", Tone.GOOD) if response.success else ("refused", Tone.CAUTION)
            self.note(f"reset {verdict}: {plain(response.message)}", tone)

    # --- the supervisor's status

    def _look(self, now_s: float) -> None:
        status = self._telemetry.look()
        self._look_for_another_robot(now_s)
        if status is not None:
            self._note_stops(status, now_s)
        if self._pilot is None:
            return
        self._look_at_round_trip(status, now_s)
        if status is None:
            return
        if self._bell.rings(warning=status.warning, nearest_m=status.nearest_m, now_s=now_s):
            self._screen.bell()
        self._look_at_own(status, now_s)

    def _note_stops(self, status: SafetyStatus, now_s: float) -> None:
        """List each stop as an event; the press of the own SPACE is one already."""
        for cause in self._stops.take(status, now_s):
            if cause != StopReason.ESTOP or self._estop_since_s is None:
                self.note(f"stopped: {cause_in_words(cause, status)}", Tone.STOP)

    def _look_for_another_robot(self, now_s: float) -> None:
        """Refuse to drive two robots at once."""
        before, self._has_two_supervisors = (
            self._has_two_supervisors,
            self._telemetry.supervisors.are_several(now_s),
        )
        if self._has_two_supervisors and not before:
            self._let_go()
            self.note(
                "two supervisors answer: two robots have this namespace, and neither is driven; give each its own",
                Tone.STOP,
            )

    def _look_at_round_trip(self, status: SafetyStatus | None, now_s: float) -> None:
        """Update the round trip by a new status, if there is one, and send zero while it is too long."""
        if status is not None:
            self._round_trip.heard(
                status.source_time_ns(self._setup.source), self._telemetry.statuses.arrival_s
            )
        was_late, self._lateness = bool(self._lateness), self._round_trip.lateness
        if was_late is not bool(self._lateness):
            self._is_lateness_noted, self._redraw = False, True
        self._let_go_if_late(now_s)

    def _let_go_if_late(self, now_s: float) -> None:
        if self._pilot is None or not self._lateness:
            return
        self._pilot.velocity(now_s)  # a pilot with held keys knows only now what it wants
        if not self._asks_for_motion():
            return
        self._let_go()
        if not self._is_lateness_noted:
            self._is_lateness_noted = True
            self.note(f"{self._lateness}: the setpoint is zero", Tone.STOP)

    def _look_at_own(self, status: SafetyStatus, now_s: float) -> None:
        """Handle refusals of this source in the status.

        Of two programs with one name, the supervisor obeys the first one while it sends. If the supervisor refuses this
        program although it receives no other, this program begins a new epoch.
        """
        own = status.source(self._setup.source)
        if own is None:
            return
        if self._refusals.another_speaks(own):
            if not self._has_rival:
                self._has_rival = True
                self.note(
                    f"another program publishes as {own.name}: the supervisor obeys the first one",
                    Tone.STOP,
                )
            if not self._sent.is_neutral:
                self._let_go()
        if self._refusals.all_refused(own, now_s):
            self._let_go()
            if self._holder is not None:
                self._holder.begin_anew()
            self._has_rival = False
            self.note("the supervisor refused all commands: this program starts again, at zero", Tone.CAUTION)

    # --- the screen

    def note(self, text: str, tone: Tone = Tone.PLAIN) -> None:
        """Say something that stays."""
        self._events.append(Event(time.strftime("%H:%M:%S"), text, tone))
        self._screen.note(text)
        self._redraw = True

    def _draw_if_due(self, now_s: float) -> float:
        """Draw if due, unless a heartbeat is near; return the time of the next drawing."""
        if not self._redraw and self._draw.lateness_s(now_s) < -TOLERANCE_S:
            return self._draw.next_s
        if self._beat.next_s - now_s < DRAW_MARGIN_S:
            return self._beat.next_s
        self._draw.tick(now_s)
        self._redraw = False
        self._show(now_s)
        return self._draw.next_s

    def _show(self, now_s: float) -> None:
        columns, rows = self._screen.size
        if self._screen.show(self._render(self._view(now_s), columns, rows)):
            self._shown_s = now_s
        elif now_s - self._shown_s > SCREEN_LIMIT_S:
            self._screen.doubt()
            if self._asks_for_motion():
                self._let_go()
                self.note("the terminal took no output: the setpoint is zero", Tone.STOP)

    def _asks_for_motion(self) -> bool:
        return self._pilot is not None and not (self._sent.is_neutral and self._pilot.wanted().is_neutral)

    def _view(self, now_s: float) -> View:
        setup, pilot, telemetry = self._setup, self._pilot, self._telemetry
        for stream in (telemetry.odom, telemetry.scan):
            stream.look()
        return View(
            setup.source,
            setup.endpoint,
            control=setup.control,
            control_note="" if pilot is None else pilot.note,
            level=None if pilot is None else pilot.level,
            limit=None if pilot is None else pilot.limit,
            wanted=NEUTRAL if pilot is None else pilot.wanted(),
            sent=self._sent,
            most=setup.most,
            status=telemetry.status,
            round_trip_s=self._round_trip.shortest_s,
            lateness=self._lateness,
            vigilance_left_s=self._vigilance_left_s(now_s),
            status_age_s=telemetry.statuses.age_s(now_s),
            odom=telemetry.odom.message,
            odom_age_s=telemetry.odom.age_s(now_s),
            scan=telemetry.scan.message,
            scan_age_s=telemetry.scan.age_s(now_s),
            rates=telemetry.rates(now_s),
            robot=setup.robot,
            events=tuple(self._events),
            keys=LEGENDS[setup.control],
            help=key_help(setup.control) if self._has_help else (),
        )
