"""The sections of a supervisor's wake-up that `bench.wakeup` times, other than its waits: real code, prepared inputs."""

import time
from collections.abc import Callable, Sequence
from functools import partial
from itertools import cycle

from bench.black_box import Kept
from bench.law import CONFIG, SCANS, TICK_S, Driver
from bench.rig import scenery
from supervisor.blackbox.recorder import BlackBox
from supervisor.law.model import Decision, Mode
from supervisor.messages import to_command, to_odometry, to_scan, to_status, to_twist
from wire import topics
from wire.bus import Subscription
from wire.message_types import M, Message
from wire.messages import decode_motion, encode, laser_scan, odometry, planar_twist
from wire.stamp import Stamper

BEAMS = 360
TICK_HZ, SCAN_HZ, COMMAND_HZ, ODOM_HZ, STATUS_HZ = 50.0, 20.0, 20.0, 50.0, 10.0
BLACK_BOX_S = 60.0

Prepare = Callable[[], Callable[[], object]]
"""Prepares one run of a section, so that only the run is measured."""


def prepared_sections() -> dict[str, tuple[float, Prepare]]:
    """Return by name the rate and the preparation of each section; needs a running event loop."""
    teleop = topics.source_cmd_vel(topics.TELEOP)
    commands = Subscription(teleop.key, teleop.type, depth=32, wake=None)
    motions = Subscription(topics.ODOM.key, topics.ODOM.type, depth=1, wake=None, per_writer=True)
    scans = Subscription(topics.SCAN.key, topics.SCAN.type, depth=1, wake=None, per_writer=True)
    velocity = scenery.FORWARD_M_S, scenery.TURN_RAD_S
    range_m = scenery.RANGE_MIN_M, scenery.RANGE_MAX_M
    sent_scans = [
        laser_scan(ranges, range_m=range_m, period_s=1.0 / SCAN_HZ) for ranges in scenery.scans(BEAMS, SCANS)
    ]
    command = _decode(
        commands, [planar_twist(*velocity)], lambda: [to_command(topics.TELEOP, a) for a in commands.take()]
    )
    motion = _decode(
        motions,
        [odometry((1.0, 2.0, 0.3), velocity)],
        lambda: [to_odometry(a) for a in motions.take_as(decode_motion)],
    )
    scan = _decode(scans, sent_scans, lambda: [to_scan(a, TICK_S) for a in scans.take()])
    free, wall = Driver(BEAMS, wall_m=scenery.ROOM_M), Driver(BEAMS)
    return {
        "decode a command": (COMMAND_HZ, command),
        "decode odometry": (ODOM_HZ, motion),
        f"decode a scan of {BEAMS} beams": (SCAN_HZ, scan),
        "step() at a tick, free": (TICK_HZ, _step(free, Mode.DRIVING, scan=False)),
        "step() at a tick, limited": (TICK_HZ, _step(wall, Mode.LIMITED, scan=False)),
        "step() with a scan, free": (SCAN_HZ, _step(free, Mode.DRIVING, scan=True)),
        "step() with a scan, limited": (SCAN_HZ, _step(wall, Mode.LIMITED, scan=True)),
        "record a tick": (TICK_HZ, _record(scan=False)),
        "record a scan step": (SCAN_HZ, _record(scan=True)),
        "encode cmd_vel": (TICK_HZ, _encode(wall, lambda decision, _: to_twist(decision.output))),
        "encode a status": (STATUS_HZ, _encode(wall, to_status)),
        "a whole tick, limited": (TICK_HZ, _whole(motion, scan=False)),
        "a whole scan, limited": (SCAN_HZ, _whole(scan, scan=True)),
    }


def _decode(
    subscription: Subscription[M], messages: Sequence[M], take: Callable[[], Sequence[object]]
) -> Prepare:
    payloads, stamper = cycle([encode(message) for message in messages]), Stamper()

    def prepare() -> Callable[[], object]:
        payload, attachment, arrival_s = next(payloads), stamper.next().pack(), time.monotonic()

        def run() -> None:
            subscription.push(payload, attachment, arrival_s)
            assert None not in take(), f"{subscription.key}: the payload must be valid"

        return run

    return prepare


def _step(driver: Driver, mode: Mode, *, scan: bool) -> Prepare:
    def prepare() -> Callable[[], object]:
        if not scan:
            driver.step(driver.inputs(scan=True))  # a plain tick follows a scan
        assert driver.mode is mode, f"the mode must be {mode.name}, it is {driver.mode.name}"
        return partial(driver.step, driver.inputs(scan=scan))

    return prepare


def _record(*, scan: bool) -> Prepare:
    driver, box = Driver(BEAMS), BlackBox(CONFIG, Kept(), window_s=BLACK_BOX_S)

    def prepare() -> Callable[[], object]:
        if not scan:
            driver.step(driver.inputs(scan=True))
        inputs, before = driver.inputs(scan=scan), driver.state
        return partial(box.record, driver.now_s, inputs, before, driver.step(inputs))

    return prepare


def _encode(driver: Driver, to_message: Callable[[Decision, float], Message]) -> Prepare:
    stamper = Stamper()

    def prepare() -> Callable[[], object]:
        decision = driver.step(driver.inputs(scan=True))
        return lambda: (encode(to_message(decision, driver.now_s)), stamper.next(driver.now_s).pack())

    return prepare


def _whole(decode: Prepare, *, scan: bool) -> Prepare:
    """Return one wake-up without its wait: decode, step(), encode cmd_vel and record."""
    driver, box, stamper = Driver(BEAMS), BlackBox(CONFIG, Kept(), window_s=BLACK_BOX_S), Stamper()

    def prepare() -> Callable[[], object]:
        if not scan:
            driver.step(driver.inputs(scan=True))
        decoded, inputs = decode(), driver.inputs(scan=scan)

        def run() -> None:
            decoded()
            before = driver.state
            decision = driver.step(inputs)
            encode(to_twist(decision.output))
            stamper.next(driver.now_s).pack()
            box.record(driver.now_s, inputs, before, decision)

        return run

    return prepare
