"""Decode and convert payloads as the services do, one at a time, and measure the cost of each."""

import math
import time
import tracemalloc
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from random import Random
from typing import Any, NamedTuple, cast

from sim.overlay import Mode
from sim.pace import TimeRequestError, parse_time_request
from sim.sensor_faults import FaultError, parse_faults
from supervisor.messages import to_command, to_odometry, to_scan
from teleop.screen.dashboard import render_dashboard
from teleop.screen.display import render
from teleop.screen.view import View
from tests.fuzz import payloads
from wire.bus import Arrival, Subscription
from wire.messages import (
    APPENDED_FROM,
    LaserScan,
    Message,
    Odometry,
    SafetyStatus,
    Twist,
    UndecodableError,
    decode,
    decode_motion,
)
from wire.stamp import parse_stamp
from wire.watchdog import Watchdog

LARGE_EVERY = 20_000
TEXT_EVERY = 20
DRAW_EVERY = 50
"""One in this many payloads is very large, is a request's text, or is drawn by the dashboard."""
TRACED_EVERY, TRACED = 10_000, 200
"""Share of the payloads whose memory is measured, which takes ten times as long."""

TIME_LIMIT_S = 1.0
"""Maximum processor time for one payload of at most 1 MiB."""
MEMORY_PER_BYTE, MEMORY_FREE_BYTES = 64, 1 << 16
"""Memory that decoding may use: per byte of the payload, and in addition."""

HEADER_TOLERANCE_S = 0.25
ARRIVALS_APART_S = 1e-4


class Case(NamedTuple):
    """One payload."""

    number: int
    message_type: type[Message] | None
    """None: the text of a request."""
    payload: bytes
    attachment: bytes | None
    text: str = ""

    @property
    def name(self) -> str:
        return "text" if self.message_type is None else self.message_type.__msgtype__


class Finding(NamedTuple):
    """A finding, and the command that replays it."""

    what: str
    payload: str
    """In hex, or a request's text."""
    replay: str


class Most(NamedTuple):
    """The payload with the highest cost."""

    value: float = 0.0
    name: str = ""
    payload_bytes: int = 0
    number: int = -1


@dataclass(slots=True)
class Tally:
    """The results of all payloads so far."""

    payloads: int = 0
    decoded: int = 0
    refused: int = 0
    slowest_s: Most = Most()
    """By processor time, among those whose memory was not counted."""
    largest_bytes: Most = Most()
    largest_small_bytes: Most = Most()
    """Among payloads of less than 8 KiB."""
    traced: int = 0
    findings: list[Finding] = field(default_factory=list[Finding])


def case(seed: int, number: int) -> Case:
    """The payload of this number."""
    random = Random((seed << 40) | number)
    stamp = payloads.attachment(random, random.random() * 1e4, payloads.epochs(random, 2))
    if number % LARGE_EVERY == LARGE_EVERY // 2:
        message_type, payload = random.choice(payloads.large_payloads())
        if random.random() < 0.3:
            payload = payload[: int(random.random() * len(payload))]
        return Case(number, message_type, payload, stamp)
    if number % TEXT_EVERY == 0:
        return Case(number, None, b"", stamp, payloads.text(random))
    message_type = random.choice(payloads.TYPES)
    return Case(number, message_type, payloads.mutated(random, message_type), stamp)


class Decoders:
    """All receivers of payloads, without state. Needs a running event loop."""

    def __init__(self) -> None:
        self._subscriptions: dict[type[Message], Subscription[Any]] = {
            kind: Subscription(kind.__msgtype__, kind, depth=1, wake=None) for kind in payloads.TYPES
        }
        self._watchdog = Watchdog()
        self._watchdog.supervisor_alive(alive=True)
        self._status: SafetyStatus | None = None
        self._scan: LaserScan | None = None
        self._odom: Odometry | None = None

    def take(self, given: Case) -> bool:
        """Process one payload; return whether it is a message.

        Raises:
            Exception: an exception that must not be raised.
            AssertionError: a result that is not permitted.
        """
        if given.message_type is None:
            _asked(given.text)
            return True
        subscription = self._subscriptions[given.message_type]
        subscription.push(given.payload, given.attachment, ARRIVALS_APART_S * given.number)
        if given.message_type is Odometry:
            self._motion(subscription, given)
        (arrival,) = subscription.take()
        _stamped(given.attachment)
        self._convert(arrival)
        if given.number % DRAW_EVERY == 1:
            self._draw(100 if given.number % 3 else 60)
        return arrival.message is not None

    def _convert(self, arrival: Arrival[Any]) -> None:
        """Convert the message as each service does."""
        match arrival.message:
            case Twist():
                self._command(arrival)
            case LaserScan() as scan:
                to_scan(arrival, HEADER_TOLERANCE_S)
                self._scan = scan
            case Odometry() as message:
                self._odom = message
            case SafetyStatus() as status:
                self._status = status
                Mode.of(status.mode)
            case _:
                return

    def _motion(self, subscription: Subscription[Any], given: Case) -> None:
        """Decode the payload as the supervisor does, and push it again for the other receivers."""
        (arrival,) = subscription.take_as(decode_motion)
        subscription.push(given.payload, given.attachment, arrival.arrival_s)
        told = to_odometry(arrival)
        assert told is None or all(map(math.isfinite, told.velocity)), "odometry that is no number was taken"

    def _command(self, arrival: Arrival[Twist]) -> None:
        velocity = to_command("teleop", arrival).velocity
        if velocity is None:
            return
        self._watchdog.command(arrival.arrival_s, *velocity)
        linear_m_s, angular_rad_s, _ = self._watchdog.target(arrival.arrival_s)
        assert math.isfinite(linear_m_s), "the base aims at a velocity that is no number"
        assert math.isfinite(angular_rad_s), "the base aims at a turn rate that is no number"

    def _draw(self, columns: int) -> None:
        view = View("teleop", "tcp/127.0.0.1:7447", status=self._status, scan=self._scan, odom=self._odom)
        lines = [*render_dashboard(view, columns, 24), render(view, columns)]
        for segment in (segment for line in lines for segment in line):
            assert segment.text.isprintable(), f"the terminal is sent {segment.text!r}"


def fuzz_decoders(seed: int, numbers: range, tally: Tally, replay: str) -> None:
    """Feed the payloads of these numbers; needs a running event loop.

    Args:
        seed: of the run.
        numbers: of its payloads.
        tally: is added to.
        replay: the command that feeds one of them again, with `{}` for its number.
    """
    decoders = Decoders()
    for kind in payloads.TYPES:  # what is created once per type is not the payload's cost
        decode(payloads.seeds(kind)[0].payload, kind)
    for kind in payloads.TYPES:
        whole = payloads.seeds(kind)[-1].payload if kind.__msgtype__ in APPENDED_FROM else b""
        for size in range(len(whole)):  # one of these ends before the appended fields
            with suppress(UndecodableError):
                decode(whole[:size], kind)
    for number in numbers:
        given = case(seed, number)
        is_traced = number % TRACED_EVERY < TRACED or number % LARGE_EVERY == LARGE_EVERY // 2
        took = _feed(decoders, given, tally, is_traced=is_traced, replay=replay.format(number))
        tally.payloads += 1
        size = len(given.payload) or len(given.text)
        most = Most(took, given.name, size, number)
        if not is_traced:
            tally.slowest_s = max(tally.slowest_s, most)
            continue
        tally.traced += 1
        tally.largest_bytes = max(tally.largest_bytes, most)
        if size < 1 << 13:
            tally.largest_small_bytes = max(tally.largest_small_bytes, most)


def _feed(decoders: Decoders, given: Case, tally: Tally, *, is_traced: bool, replay: str) -> float:
    """Feed one payload; return its processor time [s], or its peak memory [bytes]."""

    def found(what: str) -> None:
        shown = given.payload.hex() if given.message_type is not None else repr(given.text)
        tally.findings.append(Finding(f"{given.name}: {what}", shown, replay))

    if is_traced:
        tracemalloc.start()
    began_s = time.thread_time()
    try:
        if decoders.take(given):
            tally.decoded += 1
        else:
            tally.refused += 1
    except Exception as error:  # noqa: BLE001 - that there is none is what is tested
        found(f"{type(error).__name__}: {error}")
    took_s = time.thread_time() - began_s
    if is_traced:
        _, peak_bytes = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        size = len(given.payload) + len(given.text)
        is_drawn = given.number % DRAW_EVERY == 1  # the memory of a picture does not count
        if not is_drawn and peak_bytes > MEMORY_PER_BYTE * size + MEMORY_FREE_BYTES:
            found(f"{peak_bytes} bytes of memory for {size} that came")
        return 0.0 if is_drawn else float(peak_bytes)
    if took_s > TIME_LIMIT_S:
        found(f"{took_s:.2f} s of processor time")
    return took_s


def _asked(text: str) -> None:
    for parse, refusal in ((parse_faults, FaultError), (parse_time_request, TimeRequestError)):
        try:
            cast("Callable[[str], object]", parse)(text)
        except refusal:
            continue


def _stamped(attachment: bytes | None) -> None:
    stamp = parse_stamp(attachment)
    assert stamp is None or len(stamp.gid) == 16, "an epoch of another length"
