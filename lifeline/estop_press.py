"""`lifeline estop`: press the emergency stop once."""

import asyncio
import sys

from deploy.stack.errors import EXIT_NOT_RUNNING
from deploy.stack.launch import Launch
from deploy.stack.observe import Observer
from deploy.stack.reach import NotRunningError, reach
from wire import topics
from wire.messages import Bool
from wire.reasons import StopReason

CONFIRM_LIMIT_S = 1.0
PERIOD_S = 0.05
"""A press is one message, which a bad link may drop: it is repeated until a status confirms it."""
EXIT_NOT_CONFIRMED = 1
OTHER_MEANS = "stop it by other means: its own button, its power"


def press(launch: Launch) -> int:
    """Press the emergency stop until the supervisor confirms it; exit 0 if it does, 1 if not, 3 if none answers."""
    return asyncio.run(_press(launch))


async def _press(launch: Launch) -> int:
    try:
        bus = await reach(launch.bus, asyncio.Event())
    except NotRunningError:
        print(
            f"lifeline: NOT stopped: no supervisor answers at {launch.bus.endpoint}; a base whose supervisor is silent "
            f"brakes by itself. If the robot moves, {OTHER_MEANS}",
            file=sys.stderr,
        )
        return EXIT_NOT_RUNNING
    assert bus is not None  # nothing sets the event
    try:
        observer, button = Observer(bus), bus.publisher(topics.ESTOP)
        for _ in range(round(CONFIRM_LIMIT_S / PERIOD_S)):
            button.put(Bool(data=True))
            if await observer.until(_is_latched, PERIOD_S):
                print("lifeline: the emergency stop is latched; reset it with r in teleop")
                return 0
        print(
            f"lifeline: NOT confirmed: the emergency stop was sent, but no status shows it. If the robot moves, {OTHER_MEANS}",
            file=sys.stderr,
        )
        return EXIT_NOT_CONFIRMED
    finally:
        await bus.close()


def _is_latched(robot: Observer) -> bool:
    return robot.status is not None and StopReason.ESTOP in robot.status.causes_and_latched()[0]
