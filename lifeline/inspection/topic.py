"""`lifeline topic echo`, `hz`, `bw`, `delay` and `pub`: print the messages of topics, or their rates, sizes and ages; publish messages."""

import asyncio
import json
import math
from collections.abc import AsyncIterator, Callable, Sequence
from dataclasses import dataclass
from typing import Any

from deploy.stack.console import note, say
from deploy.stack.errors import DeployError
from deploy.stack.formatting import number
from lifeline.inspection.listening import Robot, inspection
from lifeline.inspection.traffic import KeyTraffic, Traffic
from lifeline.inspection.values import (
    ValueRefusedError,
    csv_line,
    finite,
    from_yaml,
    leaves,
    plain_value,
    select,
    to_yaml,
)
from teleop.holder import HeldError, Holder, about_this_process
from wire import topics
from wire.bus import Overheard, wait_until
from wire.messages import Message, UndecodableError, decode, zero_twist
from wire.text import printable
from wire.topics import ANYONE, Topic

REPORT_PERIOD_S = 1.0
HINT_S = 2.0
"""How long `topic echo` waits for a first message before it says so."""
HEX_BYTES = 64
"""How much of a payload of unknown type is printed."""


ARM_S = 1.0
"""How long a command source sends zero before it moves the robot: only a neutral command arms it."""


@dataclass(frozen=True, slots=True)
class Echo:
    """What `topic echo` prints of each message."""

    once: bool = False
    field: str = ""
    as_csv: bool = False
    as_json: bool = False


@inspection
async def echo(robot: Robot, names: Sequence[str], wanted: Echo) -> int:
    """Print the messages of some topics until Ctrl-C."""
    keys = [robot.key(name) for name in names]
    with_header: set[str] = set()
    silent = set(keys)
    asyncio.get_running_loop().call_later(HINT_S, _note_silence, robot, silent)
    async for sample in _samples(robot, keys):
        silent.discard(sample.key)
        value = value_of(sample, robot.topic(sample.key))
        if wanted.field:
            try:
                value = select(value, wanted.field)
            except ValueRefusedError as error:
                raise DeployError(f"{sample.key}: {error}") from error
        print_value(sample.key, value, wanted, with_header, several=len(keys) > 1)
        if wanted.once:
            break
    return 0


def _note_silence(robot: Robot, silent: set[str]) -> None:
    """Name the topics on which nothing has been heard, on standard error."""
    for key in sorted(silent):
        what = "" if robot.topic(key) is not None else ", which is not a topic of this robot"
        note(f"nothing heard on {key}{what}: see `lifeline topic list`; still listening")


async def _samples(robot: Robot, keys: Sequence[str]) -> AsyncIterator[Overheard]:
    """Yield the samples of some keys until Ctrl-C."""
    wake = asyncio.Event()
    inboxes = [robot.overhear(key, wake) for key in keys]
    stopping = asyncio.ensure_future(robot.stop.wait())
    stopping.add_done_callback(lambda _: wake.set())
    while True:
        await wake.wait()
        wake.clear()
        for sample in sorted(
            (one for inbox in inboxes for one in inbox.take()), key=lambda one: one.arrival_s
        ):
            if robot.stop.is_set():
                break
            yield sample
            await asyncio.sleep(0)  # printing may be slow: let the event loop handle Ctrl-C
        if robot.stop.is_set():
            return


def value_of(sample: Overheard, topic: Topic[Any] | None) -> Any:  # noqa: ANN401 - the nesting depends on the type
    """Return a sample's message as a plain value; of an unknown type or a damaged payload, its bytes."""
    raw = {"bytes": len(sample.payload), "hex": sample.payload[:HEX_BYTES].hex(" ")}
    if topic is None:
        return raw
    try:
        return plain_value(decode(sample.payload, topic.type))
    except UndecodableError:
        return {"not_a": topic.type.__msgtype__, **raw}


def print_value(key: str, value: object, wanted: Echo, with_header: set[str], *, several: bool) -> None:
    if wanted.as_json:
        print(json.dumps({"key": key, "value": finite(value)}), flush=True)
    elif wanted.as_csv:
        rows = list(leaves(value))
        if key not in with_header:
            with_header.add(key)
            print(csv_line([*(["key"] if several else []), *(name or wanted.field for name, _ in rows)]))
        print(csv_line([*([printable(key)] if several else []), *(one for _, one in rows)]), flush=True)
    else:
        print(
            f"{f'# {printable(key)}' if several else ''}{chr(10) if several else ''}{to_yaml(value)}---",
            flush=True,
        )


Report = Callable[[KeyTraffic], tuple[str, dict[str, float | int | None]]]


def rate_report(heard: KeyTraffic) -> tuple[str, dict[str, float | int | None]]:
    """Return the rate of a key and its gaps."""
    gaps = heard.gaps
    text = (
        f"{heard.rate_hz:.2f} Hz, gaps {1000 * gaps.minimum_s:.1f} to {1000 * gaps.maximum_s:.1f} ms, "
        f"std dev {1000 * gaps.deviation_s:.2f} ms, {heard.samples} samples"
    )
    return text, {
        "rate_hz": number(heard.rate_hz),
        "gap_min_s": number(gaps.minimum_s),
        "gap_max_s": number(gaps.maximum_s),
        "gap_std_dev_s": number(gaps.deviation_s),
        "samples": heard.samples,
    }


def size_report(heard: KeyTraffic) -> tuple[str, dict[str, float | int | None]]:
    """Return the bandwidth of a key."""
    text = (
        f"{heard.bytes_s / 1000:.2f} kB/s, {min(heard.sizes)} to {max(heard.sizes)} bytes a message, "
        f"{heard.samples} samples"
    )
    return text, {
        "bytes_per_s": number(heard.bytes_s),
        "size_min_bytes": min(heard.sizes),
        "size_max_bytes": max(heard.sizes),
        "samples": heard.samples,
    }


def age_report(heard: KeyTraffic) -> tuple[str, dict[str, float | int | None]]:
    """Return the ages of a key's samples at their arrival."""
    ages = heard.ages
    numbers: dict[str, float | int | None] = {
        "age_min_s": None,
        "age_mean_s": None,
        "age_max_s": None,
        "samples": heard.samples,
    }
    if not ages.number:
        return "no message has a stamp, so its age is unknown", numbers
    if heard.is_other_clock:
        return "the sender's clock is not this machine's, so the age is unknown", numbers
    numbers |= {"age_min_s": ages.minimum_s, "age_mean_s": ages.mean_s, "age_max_s": ages.maximum_s}
    text = (
        f"{1000 * ages.mean_s:.2f} ms old at arrival, {1000 * ages.minimum_s:.2f} to {1000 * ages.maximum_s:.2f} ms, "
        f"{ages.number} samples"
    )
    return text, numbers


@inspection
async def measure(
    robot: Robot, names: Sequence[str], report: Report, seconds: float | None, *, as_json: bool
) -> int:
    """Print a report on some topics every second, until Ctrl-C or for some seconds. Exit 1 if nothing was heard."""
    keys = [robot.key(name) for name in names]
    inboxes = [robot.overhear(key) for key in keys]
    traffic, loop = Traffic(), asyncio.get_running_loop()
    end_s = math.inf if seconds is None else loop.time() + seconds
    while not robot.stop.is_set() and loop.time() < end_s:
        await wait_until(robot.stop, min(end_s, loop.time() + REPORT_PERIOD_S))
        for sample in (one for inbox in inboxes for one in inbox.take()):
            traffic.add(sample)
        if seconds is None or loop.time() >= end_s or robot.stop.is_set():
            for key in keys:
                _print_report(key, traffic.keys.get(key), report, as_json=as_json)
    return 0 if all(key in traffic.keys for key in keys) else 1


def _print_report(key: str, heard: KeyTraffic | None, report: Report, *, as_json: bool) -> None:
    text, numbers = ("nothing heard", {"samples": 0}) if heard is None else report(heard)
    print(json.dumps({"key": key, **numbers}) if as_json else f"{key}: {text}", flush=True)


# --- publish


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
        say(f"published on {robot.namespace}/{topic.key}")
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
    say(f"sending zero for {ARM_S:g} s, which arms {source}, then the message until Ctrl-C")
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
