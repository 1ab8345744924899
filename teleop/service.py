"""The asyncio shell: one loop reads the keys, sends the heartbeat and draws the line.

The heartbeat is proof that this very loop runs: whatever hangs here silences it, and the supervisor stops
the robot. After a hang nothing is made up for: the missed beats are gone, the setpoint is zero, and keys
that were typed meanwhile move nothing (they were pressed for a robot that did not answer).
"""

import asyncio
from collections.abc import Iterable
from typing import Protocol

from teleop.config import TeleopSection
from teleop.display import Line, View, plain, render
from teleop.keymap import Action, action_for
from teleop.rate import Rate
from teleop.setpoint import Setpoint
from wire import topics
from wire.bus import Arrival, Bus, NoReplyError
from wire.messages import Bool, SafetyStatus, TriggerResponse, planar_twist

DRAW_PERIOD_S = 0.1
HANG_S = 0.15
"""A heartbeat this late was a hang: at 20 Hz the supervisor has stopped the robot by then (0.2 s)."""
SCREEN_LIMIT_S = 0.5
"""Whoever does not see the line must not drive by it: a terminal stuck for this long stops the robot."""
RESET_TIMEOUT_S = 1.0

_MOTION = frozenset({Action.FASTER, Action.SLOWER, Action.LEFT, Action.RIGHT})


class KeySource(Protocol):
    """Where keys come from. Whenever there are some, or they end, it sets the `wake` of its Teleop."""

    @property
    def ended(self) -> bool:
        """No more keys will ever come."""
        ...

    def take(self) -> list[str]:
        """Every key pressed until now; never blocks."""
        ...


class Screen(Protocol):
    """Where the line goes."""

    @property
    def width(self) -> int:
        """Columns that a line may have."""
        ...

    def show(self, line: Line) -> bool:
        """Put `line` in the place of the last one; False: the terminal takes no output now. Never blocks."""
        ...

    def note(self, text: str) -> None:
        """Say something that stays, above the line."""
        ...


class Teleop:
    """One command source on the bus, driven by keys.

    Args:
        bus: open; the caller closes it.
        config: `[teleop]`.
        keys: where the keys come from.
        screen: where the line goes.
        wake: set by the key source whenever there is something to take.
        endpoint: of the supervisor, for the display.
    """

    def __init__(
        self,
        bus: Bus,
        config: TeleopSection,
        *,
        keys: KeySource,
        screen: Screen,
        wake: asyncio.Event,
        endpoint: str,
    ) -> None:
        self._bus, self._config, self._keys, self._screen = bus, config, keys, screen
        self._wake, self._endpoint = wake, endpoint
        self._cmd_vel = bus.publisher(topics.source_cmd_vel(config.source))
        self._estop = bus.publisher(topics.ESTOP)
        self._statuses = bus.subscribe(topics.STATUS)
        self._setpoint = Setpoint(config.to_steps())
        self._status: Arrival[SafetyStatus] | None = None
        self._estop_since_s: float | None = None
        """When SPACE was pressed, until the supervisor's status shows that it knows."""
        self._reset: asyncio.Task[TriggerResponse] | None = None
        self._quitting = False
        now_s = asyncio.get_running_loop().time()
        self._beat = Rate(1 / config.rate_hz, now_s)
        self._draw = Rate(DRAW_PERIOD_S, now_s)
        self._shown_s = now_s

    async def run(self, stop: asyncio.Event) -> None:
        """Drive until a key, the end of the keys or `stop` says otherwise; leaves with a zero and without token.

        Raises:
            Exception: whatever went wrong, also in the reset's task.
        """
        loop = asyncio.get_running_loop()
        stopping = loop.create_task(stop.wait())
        stopping.add_done_callback(lambda _: self._wake.set())
        token = self._bus.declare_alive(self._config.source)
        try:
            while True:
                self._turn(loop.time())
                if self._quitting or self._keys.ended or stop.is_set():
                    break
                timer = loop.call_at(min(self._beat.next_s, self._draw.next_s), self._wake.set)
                await self._wake.wait()
                timer.cancel()
                self._wake.clear()
        finally:
            stopping.cancel()
            if self._reset is not None:
                self._reset.cancel()
            try:
                self._set(self._setpoint.neutral())
            finally:
                token.withdraw()

    def _turn(self, now_s: float) -> None:
        actions = [action for key in self._keys.take() if (action := action_for(key)) is not None]
        late_s = self._beat.lateness_s(now_s)
        if late_s > HANG_S:
            self._recover(late_s)
            actions = [action for action in actions if action not in _MOTION]
        self._act(actions, now_s)
        self._status = self._statuses.latest() or self._status
        if self._beat.tick(now_s):
            self._publish()
            self._repeat_estop()
        self._finish_reset()
        if self._draw.tick(now_s) or actions:
            self._show(now_s)

    def _recover(self, late_s: float) -> None:
        self._setpoint = self._setpoint.neutral()
        self._screen.note(
            f"teleop hung for {late_s:.1f} s: the setpoint is zero, keys typed meanwhile are void"
        )

    def _act(self, actions: Iterable[Action], now_s: float) -> None:
        for action in actions:
            self._set(self._setpoint.apply(action), always=action in (Action.STOP, Action.ESTOP))
            match action:
                case Action.ESTOP:
                    self._estop_since_s = now_s
                    self._estop.put(Bool(data=True))
                    self._screen.note("emergency stop")
                case Action.RESET:
                    self._ask_reset()
                case Action.QUIT:
                    self._quitting = True
                    return  # what was typed after it is not for the robot
                case _:
                    pass

    def _set(self, setpoint: Setpoint, *, always: bool = True) -> None:
        changed = setpoint != self._setpoint
        self._setpoint = setpoint
        if changed or always:
            self._publish()

    def _publish(self) -> None:
        self._cmd_vel.put(planar_twist(self._setpoint.linear_m_s, self._setpoint.angular_rad_s))

    def _repeat_estop(self) -> None:
        """One sample can get lost with a link; the wish to stop is repeated until it shows."""
        if self._estop_since_s is None:
            return
        newest = self._status
        if newest is not None and newest.message is not None and newest.arrival_s > self._estop_since_s:
            known = "ESTOP" in newest.message.reasons
        else:
            known = False
        if known:
            self._estop_since_s = None
        else:
            self._estop.put(Bool(data=True))

    def _ask_reset(self) -> None:
        if self._reset is not None:
            return  # one is under way
        self._estop_since_s = None
        call = self._bus.call(topics.SUPERVISOR_RESET, timeout_s=RESET_TIMEOUT_S)
        self._reset = asyncio.get_running_loop().create_task(call)
        self._reset.add_done_callback(lambda _: self._wake.set())

    def _finish_reset(self) -> None:
        if self._reset is None or not self._reset.done():
            return
        task, self._reset = self._reset, None
        try:
            response = task.result()
        except NoReplyError as error:
            self._screen.note(f"reset: {plain(str(error))}")
        else:
            self._screen.note(f"reset {'done' if response.success else 'refused'}: {plain(response.message)}")

    def _show(self, now_s: float) -> None:
        newest = self._status
        view = View(
            self._setpoint,
            self._config.source,
            self._endpoint,
            None if newest is None else newest.message,
            0.0 if newest is None else now_s - newest.arrival_s,
        )
        if self._screen.show(render(view, self._screen.width)):
            self._shown_s = now_s
        elif now_s - self._shown_s > SCREEN_LIMIT_S and not self._setpoint.is_neutral:
            self._set(self._setpoint.neutral())
            self._screen.note("the terminal took no output: the setpoint is zero")
