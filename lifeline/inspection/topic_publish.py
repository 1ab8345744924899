"""`lifeline topic pub`: publish on topics that are open to tools."""

import asyncio
from typing import Any

from deploy.stack.errors import DeployError
from lifeline.inspection.listening import Robot, inspection
from lifeline.inspection.values import ValueRefusedError, from_yaml
from teleop.holder import HeldError, Holder, about_this_process
from wire import topics
from wire.bus import wait_until
from wire.messages import Message, zero_twist
from wire.topics import ANYONE, Topic

ARM_S = 1.0
"""How long a command source sends zero before it moves the robot: only a neutral command arms it."""


@inspection
async def publish(robot: Robot, name: str, text: str, rate_hz: float | None, *, once: bool) -> int:
    """Publish a message on a topic that is open to tools, once or until Ctrl-C."""
    key = robot.key(name)
    topic = robot.topic(key)
    source = may_publish(key, topic, robot)
    assert topic is not None
    try:
        message = from_yaml(text, topic.type)
    except ValueRefusedError as error:
        raise DeployError(f"{key}: {error}") from error
    period_s = 1.0 / (rate_hz or topic.rate_hz or 1.0)
    if source is None:
        return await _publish(robot, topic, message, period_s, once=once or rate_hz is None)
    limit_s = robot.config.command_timeout_s
    if period_s > limit_s / 2:
        raise DeployError(
            f"commands older than {limit_s:g} s stop the robot: choose --rate {2 / limit_s:.0f} or more"
        )
    if once:
        raise DeployError(
            f"{key} needs a stream of commands, because one command does not move the robot: leave out --once"
        )
    return await _publish_as(robot, source, message, period_s)


def may_publish(key: str, topic: Topic[Any] | None, robot: Robot) -> str | None:
    """Return the command source whose name is needed to publish on a key; None if anyone may publish on it.

    Raises:
        DeployError: the key belongs to another program.
    """
    if topic is None:
        raise DeployError(f"{key} is not a topic of this robot: see `lifeline topic list`")
    if topic.writer == ANYONE:
        return None
    relative = key.removeprefix(f"{robot.namespace}/")
    source = topics.source_of(relative)
    if source is None:
        raise DeployError(f"{key} belongs to {topic.writer}: only {topic.writer} may publish on it")
    if source not in robot.sources:
        raise DeployError(
            f"{source} is not a command source of this robot ({', '.join(robot.sources)}): add it to "
            f"[supervisor] sources in {robot.launch.config}"
        )
    return source


async def _publish(robot: Robot, topic: Topic[Any], message: Message, period_s: float, *, once: bool) -> int:
    publisher = robot.bus.publisher(topic)
    publisher.put(message)
    if once:
        await robot.bus.close()  # the message is sent before the session ends
        print(f"lifeline: published on {robot.namespace}/{topic.key}", flush=True)
        return 0
    while not robot.stop.is_set():
        await wait_until(robot.stop, asyncio.get_running_loop().time() + period_s)
        publisher.put(message)
    return 0


async def _publish_as(robot: Robot, source: str, message: Message, period_s: float) -> int:
    """Command the robot as a source: zero first, which arms it, then the message; zero at the end."""
    publisher = robot.bus.publisher(topics.source_cmd_vel(source))
    holder = Holder(robot.bus, source, publisher, about_this_process(source))
    try:
        await holder.claim()
    except HeldError as error:
        raise DeployError(f"the command source {source} is held by {error}") from error
    loop = asyncio.get_running_loop()
    print(f"lifeline: zero for {ARM_S:g} s, which arms {source}, then the message, until Ctrl-C", flush=True)
    armed_s = loop.time() + ARM_S
    try:
        while not robot.stop.is_set():
            publisher.put(zero_twist() if loop.time() < armed_s else message)
            await wait_until(robot.stop, loop.time() + period_s)
    finally:
        publisher.put(zero_twist())
        await holder.leave()
        await robot.bus.close()
    return 0
