"""`lifeline topic echo`, `hz`, `bw` and `delay`: print the messages of topics, or their rates, sizes and ages."""

import asyncio
import json
import math
import sys
from collections.abc import AsyncIterator, Callable, Sequence
from dataclasses import dataclass
from typing import Any

from deploy.stack.errors import DeployError
from deploy.stack.formatting import number
from lifeline.inspection.listening import Robot, inspection
from lifeline.inspection.traffic import KeyTraffic, Traffic
from lifeline.inspection.values import (
    ValueRefusedError,
    csv_line,
    finite,
    leaves,
    plain_value,
    select,
    to_yaml,
)
from wire.bus import Overheard, wait_until
from wire.messages import UndecodableError, decode
from wire.topics import Topic

REPORT_PERIOD_S = 1.0
HINT_S = 2.0
"""How long `topic echo` waits for a first message before it says so."""
HEX_BYTES = 64
"""How much of a payload of unknown type is printed."""


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
        _print_value(sample.key, value, wanted, with_header, several=len(keys) > 1)
        if wanted.once:
            break
    return 0


def _note_silence(robot: Robot, silent: set[str]) -> None:
    """Name the topics on which nothing has been heard, on standard error."""
    for key in sorted(silent):
        what = "" if robot.topic(key) is not None else ", which is not a topic of this robot"
        print(
            f"lifeline: nothing heard on {key}{what}: see `lifeline topic list`; still listening",
            file=sys.stderr,
        )


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
            await asyncio.sleep(0)  # printing may be slow: let Ctrl-C in
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


def _print_value(key: str, value: object, wanted: Echo, with_header: set[str], *, several: bool) -> None:
    if wanted.as_json:
        print(json.dumps({"key": key, "value": finite(value)}), flush=True)
    elif wanted.as_csv:
        rows = list(leaves(value))
        if key not in with_header:
            with_header.add(key)
            print(csv_line([*(["key"] if several else []), *(name or wanted.field for name, _ in rows)]))
        print(csv_line([*([key] if several else []), *(one for _, one in rows)]), flush=True)
    else:
        print(f"{f'# {key}' if several else ''}{chr(10) if several else ''}{to_yaml(value)}---", flush=True)


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
