"""`lifeline ros2 check-base`: measure how long the base keeps its last command when its commands end.

If the ROS 2 process or its computer dies, only the base's own timeout stops the robot. To measure this timeout, the robot
turns on the spot, the commands end without a zero, and odometry shows when the robot stands.
"""

import asyncio
import math
import sys
import time
from collections.abc import Awaitable, Callable

from ros2 import ros
from ros2.base_clock import ODOM_DEPTH, BaseClock
from ros2.commands import message
from ros2.config import Ros2Section
from ros2.reports import clause
from ros2.ros import Ros, twist_type
from ros2.samples import Sample
from wire import cdr
from wire.inbox import Inbox, woken_by

TURN_RAD_S = 0.3
MOVING_RAD_S = 0.1
STANDING_RAD_S = 0.03
TURN_S = 1.5
PERIOD_S = 0.05
DISCOVERY_S = 1.5
"""For discovery to find the other publishers: each node announces itself every 0.5 s to 3 s, and when it hears a new one."""
ODOM_LIMIT_S = 5.0
STOP_LIMIT_S = 3.0
GOOD_S = 1.0
"""At 1 m/s, a base that stops within this time travels about 1 m after its computer dies."""

LONGEST_S = 2.0
"""The longest `base_timeout_s` that `[supervisor]` accepts."""

MakeNode = Callable[[Callable[[BaseException], None]], Awaitable[Ros]]
"""Returns the node; its argument is called on any thread with an exception of a callback."""

EXIT_NO_TIMEOUT, EXIT_NOT_MEASURED = 1, 3


def advice(took_s: float, clock_problem: str | None) -> str:
    """Return what to do about a base that stood `took_s` after its last command."""
    least_s = math.ceil(100.0 * took_s) / 100.0
    setting = f"set base_timeout_s in [supervisor] to at least {least_s:.2f}"
    if took_s <= GOOD_S:
        return setting
    remedy = clock_problem or "reduce the cmd_vel timeout of the base's controller, to 0.25 s for example"
    is_long = f"more than {GOOD_S:g} s is long: {remedy}"
    return f"{is_long}\nuntil then, {setting}" if least_s <= LONGEST_S else is_long


async def check_base(
    stop: asyncio.Event,
    config: Ros2Section,
    make_node: MakeNode,
    *,
    ask: bool,
) -> int:
    """Run the check; return 0 if the base stops by itself, 1 if not, 3 if its timeout could not be measured.

    Args:
        stop: set by a signal; the robot is then commanded zero.
        config: `[ros2]`.
        make_node: returns the node.
        ask: whether a person must confirm that the robot may move.
    """
    loop = asyncio.get_running_loop()

    def on_failure(error: BaseException) -> None:
        print(f"the node failed: {error}")
        loop.call_soon_threadsafe(stop.set)

    node = await make_node(on_failure)
    check = _Check(stop, config, node)
    node.start()
    try:
        return await check.run(ask=ask)
    finally:
        check.command(cdr.STANDSTILL)
        await asyncio.to_thread(node.close)


class _Check:
    def __init__(self, stop: asyncio.Event, config: Ros2Section, node: Ros) -> None:
        self._stop, self._config, self._node = stop, config, node
        self._loop = asyncio.get_running_loop()
        self._wake = asyncio.Event()
        self._odom: Inbox[Sample] = Inbox(ODOM_DEPTH, self._wake)
        self._clock = BaseClock(config.stamp)
        self._odom_topic = config.resolved(config.odom)
        self._topic = config.resolved(config.cmd_vel)
        node.subscribe(self._odom_topic, ros.ODOMETRY, self._odom.push, lambda: None)
        self._publish = node.publisher(self._topic, twist_type(stamped=config.stamped), lambda: None)
        self._turn_rad_s = math.nan

    def command(self, velocity: cdr.Planar) -> None:
        self._publish(message(velocity, self._config, self._clock.stamp_ns(time.time_ns())))

    async def run(self, *, ask: bool) -> int:
        print(f"waiting for odometry on {self._odom_topic}")
        if not await self._until(lambda: not math.isnan(self._turn_rad_s), ODOM_LIMIT_S):
            return self._not_measured(
                f"no odometry arrived on {self._odom_topic} within {ODOM_LIMIT_S:g} s: start the base's driver, or "
                "correct odom in [ros2]"
            )
        await self._until(lambda: False, DISCOVERY_S)
        if rival := self._rival():
            return self._not_measured(rival)
        if not self._clock.may_move(self._loop.time()):
            return self._not_measured(self._clock.problem(self._loop.time()) or "")
        if not self._node.subscriptions(self._topic):
            return self._not_measured(f"no node listens on {self._topic}: correct cmd_vel in [ros2]")
        print(
            f"The robot will turn on the spot at {TURN_RAD_S:g} rad/s for about {TURN_S + STOP_LIMIT_S:g} s at most."
        )
        if ask and not await self._confirmed():
            return self._not_measured("not confirmed, so the robot was not moved")
        if rival := self._rival():
            return self._not_measured(rival)
        return await self._measure()

    def _rival(self) -> str | None:
        """Return a sentence if another program commands the base; None if none is known."""
        publishers = self._node.publishers(self._topic)
        if len(publishers) <= 1:  # this process
            return None
        others = [p for p in publishers if p.node != self._node.name]
        if not others:
            return f"Lifeline itself commands {self._topic}: end it first with `lifeline down`"
        return f"{clause(others, 'publish')} on {self._topic}: end all other programs that command the base first"

    async def _confirmed(self) -> bool:
        if not sys.stdin.isatty():
            print("no terminal to confirm: give --yes")
            return False
        print("Keep 1 m around it free. Enter: start; Ctrl-C: end")
        pressed: asyncio.Future[bool] = self._loop.create_future()
        self._loop.add_reader(
            sys.stdin.fileno(), lambda: pressed.done() or pressed.set_result(bool(sys.stdin.readline()))
        )
        stopping = asyncio.ensure_future(self._stop.wait())
        await asyncio.wait({pressed, stopping}, return_when=asyncio.FIRST_COMPLETED)
        self._loop.remove_reader(sys.stdin.fileno())
        return pressed.done() and pressed.result()

    async def _measure(self) -> int:
        end_s = self._loop.time() + TURN_S
        while self._loop.time() < end_s and not self._stop.is_set():
            if rival := self._rival():
                return self._not_measured(rival)
            self.command(cdr.Planar(0.0, TURN_RAD_S))
            await self._until(lambda: False, PERIOD_S)
        silent_s = self._loop.time()
        if abs(self._turn_rad_s) < MOVING_RAD_S:
            cause = self._clock_problem(ahead=True) or (
                f"check its e-stop, and whether the base expects {twist_type(stamped=not self._config.stamped)} "
                "(stamped in [ros2])"
            )
            return self._not_measured(
                f"the robot did not turn (odometry: {self._turn_rad_s:.2f} rad/s): {cause}"
            )
        print("commands have ended without a zero")
        if await self._until(lambda: abs(self._turn_rad_s) < STANDING_RAD_S, STOP_LIMIT_S):
            took_s = self._loop.time() - silent_s
            print(f"the base stood {took_s:.2f} s after its last command: it has a timeout of its own")
            print(advice(took_s, self._clock_problem(ahead=False)))
            return 0
        if self._stop.is_set():
            return self._not_measured("ended by a signal")
        cause = self._clock_problem(ahead=False) or (
            "it keeps its last command without a limit, or for too long. If Lifeline's computer dies while the robot "
            "moves, nothing stops it. Set the cmd_vel timeout of the base's controller (ros2_control: cmd_vel_timeout, in "
            "s; it must not be 0.0, which switches the timeout off)"
        )
        print(f"the base still moved {STOP_LIMIT_S:g} s after its last command: {cause}")
        return EXIT_NO_TIMEOUT

    def _clock_problem(self, *, ahead: bool) -> str | None:
        """Return what is wrong with the stamps of commands, if the base's clock is ahead or behind; else None."""
        is_so = (self._clock.ahead_s > 0.0) is ahead
        return self._clock.problem(self._loop.time()) if is_so else None

    async def _until(self, holds: Callable[[], bool], limit_s: float) -> bool:
        """Follow odometry until a condition holds; return whether it did within the limit and before a signal."""
        end_s = self._loop.time() + limit_s
        while self._loop.time() < end_s and not self._stop.is_set():
            await woken_by(self._wake, min(end_s, self._loop.time() + PERIOD_S))
            self._wake.clear()
            for sample in self._odom.take():
                if self._config.stamped:
                    self._clock.hear(sample)
                motion = cdr.unpack_motion(sample.payload)
                if motion is not None and math.isfinite(motion.angular_rad_s):
                    self._turn_rad_s = motion.angular_rad_s
            if holds():
                return True
        return False

    @staticmethod
    def _not_measured(sentence: str) -> int:
        print(sentence)
        return EXIT_NOT_MEASURED
