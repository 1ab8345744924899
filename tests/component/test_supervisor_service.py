"""The supervisor's service on a perfect network and a virtual clock: what it publishes when, on which key."""

import asyncio
import itertools
import logging
import math
from collections.abc import Callable

import numpy as np
import pytest

from supervisor import service
from supervisor.law.certificate import Certificate
from supervisor.law.decision import Decision
from supervisor.law.model import Inputs
from supervisor.law.reckoning import Velocity
from supervisor.law.state import State
from tests.component.rig import Rig, laser_scan
from tests.scan_stamps import PROBLEMS, SECOND_NS, STAMPS
from virtual.loop import VirtualLoop
from virtual.network import HOP_S
from wire import topics
from wire.bus import LivelinessChange
from wire.messages import (
    Bool,
    Message,
    SafetyStatus,
    SourceStatus,
    Twist,
    Vector3,
    encode,
    odometry,
    planar_twist,
    zero_twist,
)
from wire.ros import Time
from wire.stamp import Stamp


def nothing_foreseen(*_: object) -> None:
    """Stands for a certificate that covers nothing."""


ZERO = (0.0, 0.0)
PRESSED, RELEASED = Bool(data=True), Bool(data=False)


async def test_it_publishes_zero_at_50_hz_from_the_start_and_says_why() -> None:
    rig = Rig()
    async with rig.supervisor():
        await rig.pass_time(2.0)
        outputs = rig.cmd_vel.take()
    assert 99 <= len(outputs) <= 102
    assert all(o.message == planar_twist(0.0, 0.0) for o in outputs)
    assert rig.newest_status.mode == SafetyStatus.STOPPED
    assert rig.newest_status.reasons == ["SCAN_STALE", "NO_COMMAND"]


async def test_the_status_comes_10_times_a_second_while_nothing_changes() -> None:
    rig = Rig()
    async with rig.supervisor():
        await rig.pass_time(1.0)
        rig.status.take()
        await asyncio.sleep(2.0)
        assert 18 <= len(rig.status.take()) <= 21


async def test_the_end_of_a_cause_is_published_before_the_next_status_is_due_and_not_logged(
    caplog: pytest.LogCaptureFixture,
) -> None:
    caplog.set_level(logging.INFO)
    rig = Rig()
    async with rig.supervisor(), rig.lidar() as ranges, rig.source():
        await rig.drive(0.5)
        ranges[:] = math.nan
        await rig.pass_time(0.5)
        assert (rig.newest_status.causes, rig.newest_status.latched) == (["SCAN_INVALID"], [])
        assert "STOPPED by teleop: SCAN_INVALID" in caplog.messages
        caplog.clear()
        wake = asyncio.Event()
        statuses = rig.outsider.subscribe(topics.STATUS, depth=10, wake=wake)
        await wake.wait()
        statuses.take()  # the next one that is due comes 0.1 s after this one
        ranges[:] = 3.0
        await asyncio.sleep(0.08)  # a scan comes within 0.05 s, and a tick within 0.02 s
        (arrival,) = statuses.take()
        assert arrival.message is not None
        assert (arrival.message.causes, arrival.message.latched) == ([], ["SCAN_INVALID"])
        assert arrival.message.reasons == ["SCAN_INVALID"]
        assert caplog.messages == []


async def test_neutral_arms_and_a_motion_passes_at_once() -> None:
    rig = Rig()
    async with rig.supervisor(), rig.lidar(), rig.source():
        await rig.drive(0.5, 0.2)
        await rig.pass_time(0.1)
        assert rig.output() == (0.5, 0.2)
        assert rig.newest_status.mode == SafetyStatus.DRIVING
        assert rig.newest_status.owner == topics.TELEOP


async def test_another_command_is_obeyed_at_once_and_a_repeated_one_keeps_it_driving() -> None:
    rig = Rig()
    asked = rig.outsider.subscribe(topics.source_cmd_vel(topics.TELEOP), depth=100)
    async with rig.supervisor(), rig.lidar(), rig.source():
        await rig.drive(0.5)
        await rig.pass_time(1.013)
        assert rig.output() == (0.5, 0.0)  # repeated twenty times by now, and never older than the timeout
        asked.take()
        rig.velocity = (0.25, 0.0)
        await rig.pass_time(0.1)
        slower = planar_twist(0.25, 0.0)
        (first, *_), (obeyed, *_) = (
            [a.arrival_s for a in heard.take() if a.message == slower] for heard in (asked, rig.cmd_vel)
        )
        assert obeyed - first < 0.001


@pytest.mark.parametrize(
    ("behind_m", "comes_before"), [(3.0, True), (0.55, False)], ids=["free path", "wall behind"]
)
async def test_a_command_on_a_free_path_is_published_before_its_step(
    monkeypatch: pytest.MonkeyPatch, behind_m: float, *, comes_before: bool
) -> None:
    rig, order = Rig(), list[str]()
    decide = service.step

    def noticed(state: State, now_s: float, inputs: Inputs) -> tuple[State, Decision]:
        if inputs.commands and inputs.commands[-1].velocity == (0.25, 0.0):
            order.append("step")
        return decide(state, now_s, inputs)

    def sent(node: str, _key: str, message: Message, _stamp: Stamp) -> None:
        if node == topics.SUPERVISOR and message == planar_twist(0.25, 0.0):
            order.append("put")

    async with rig.supervisor(), rig.lidar() as ranges, rig.source():
        ranges[:20] = ranges[-20:] = behind_m
        await rig.drive(0.3)
        monkeypatch.setattr(service, "step", noticed)
        rig.network.tap = sent
        rig.velocity = (0.25, 0.0)
        await rig.pass_time(0.06)
    assert order[:2] == (["put", "step"] if comes_before else ["step", "put"])


async def test_a_step_that_decides_otherwise_than_foreseen_is_obeyed_at_once_and_nothing_is_foreseen_again(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    rig, wrong, right = Rig(), planar_twist(0.4, 0.0), planar_twist(0.5, 0.0)

    def mistaken(certificate: Certificate | None, _now_s: float, _inputs: Inputs) -> Velocity | None:
        return None if certificate is None else Velocity(0.4, 0.0)

    async with rig.supervisor(), rig.lidar(), rig.source():
        await rig.drive(0.5)
        rig.cmd_vel.take()
        monkeypatch.setattr(service, "foreseen", mistaken)
        await rig.pass_time(0.5)
        heard = itertools.dropwhile(lambda a: a.message == right, rig.cmd_vel.take())
        first, second, *others = heard
    assert (first.message, second.message) == (wrong, right)
    assert second.arrival_s == first.arrival_s
    assert all(arrival.message == right for arrival in others[:-1])
    (line,) = (record for record in caplog.messages if "certificate" in record)
    assert "0.4 m/s, 0.0 rad/s was published, but the step has decided 0.5 m/s" in line


async def test_a_dead_source_stops_it_within_the_same_instant() -> None:
    rig = Rig()
    async with rig.supervisor(), rig.lidar():
        async with rig.source() as teleop:
            await rig.drive(0.5)
            await rig.pass_time(1.013)
            rig.cmd_vel.take()
            tokens = rig.outsider.watch_alive()
            teleop.die()
            await rig.pass_time(0.01)
            *_, death = tokens.take()
            first = rig.cmd_vel.take()[0]
            assert first.message == planar_twist(0.0, 0.0)
            assert first.arrival_s - death.arrival_s < 0.001
        assert rig.newest_status.reasons == ["SOURCE_LOST"]


async def test_a_silent_source_stops_it_when_its_last_command_runs_out_and_no_tick_later() -> None:
    rig = Rig()
    asked = rig.outsider.subscribe(topics.source_cmd_vel(topics.TELEOP), depth=100)
    async with rig.supervisor(), rig.lidar():
        async with rig.source():
            await rig.drive(0.5)
            await rig.pass_time(0.513)
        assert await _stopped_after_s(rig, asked.take()[-1].arrival_s) == pytest.approx(0.2, abs=1e-5)
        assert rig.newest_status.reasons == ["COMMAND_TIMEOUT"]


async def test_a_silent_lidar_stops_it_when_its_last_scan_runs_out_and_no_tick_later() -> None:
    rig = Rig()
    scans = rig.outsider.subscribe(topics.SCAN, depth=100)
    async with rig.supervisor(), rig.source():
        async with rig.lidar():
            await rig.drive(0.5)
            await rig.pass_time(0.513)
        assert await _stopped_after_s(rig, scans.take()[-1].arrival_s) == pytest.approx(0.24, abs=1e-5)
        assert rig.newest_status.reasons == ["SCAN_STALE"]


async def _stopped_after_s(rig: Rig, last_s: float) -> float:
    """From the last thing that came to the first zero after it, at the supervisor: a hop away."""
    rig.cmd_vel.take()
    await rig.pass_time(0.3)
    return next(o.arrival_s for o in rig.cmd_vel.take() if o.message == zero_twist()) - last_s - 2 * HOP_S


async def test_something_inside_30_cm_stops_it_with_the_very_scan() -> None:
    rig = Rig()
    async with rig.supervisor(), rig.source(), rig.lidar() as ranges:
        await rig.drive(0.5)
        ranges[170:191] = 0.5
        await rig.pass_time(0.06)
        assert rig.output() == ZERO
        assert rig.newest_status.reasons == ["OBSTACLE"]
        assert rig.newest_status.warning


@pytest.mark.parametrize(
    "payload",
    [b"", b"\x00\x01\x00\x00", b"\xff" * 52, b"\x00\x01\x00\x00" + b"\x7f" * 2_000_000],
)
async def test_bytes_that_are_no_twist_stop_it(payload: bytes) -> None:
    rig = Rig()
    async with rig.supervisor(), rig.lidar(), rig.source():
        await rig.drive(0.5)
        rig.outsider.send(topics.source_cmd_vel(topics.TELEOP).key, payload, None)
        await rig.pass_time(0.01)
        assert rig.output() == ZERO
        assert "COMMAND_INVALID" in rig.newest_status.reasons


@pytest.mark.parametrize(
    "twist",
    [
        planar_twist(math.nan, 0.0),
        planar_twist(0.0, math.inf),
        Twist(Vector3(0.5, 0.1, 0.0), Vector3(0.0, 0.0, 0.0)),
        Twist(Vector3(0.5, 0.0, 0.0), Vector3(math.nan, 0.0, 0.0)),
    ],
)
async def test_a_twist_that_a_ground_robot_cannot_drive_stops_it(twist: Twist) -> None:
    rig = Rig()
    async with rig.supervisor(), rig.lidar(), rig.source() as teleop:
        await rig.drive(0.5)
        teleop.publisher(topics.source_cmd_vel(topics.TELEOP)).put(twist)
        await rig.pass_time(0.01)
        assert rig.output() == ZERO


async def test_a_flood_of_estop_messages_cannot_hide_a_press() -> None:
    rig = Rig()
    async with rig.supervisor(), rig.lidar(), rig.source():
        await rig.drive(0.5)
        button = rig.network.open_joined("button").publisher(topics.ESTOP)
        button.put(PRESSED)
        for _ in range(1000):
            button.put(RELEASED)
        await rig.pass_time(0.1)
        assert rig.newest_status.reasons == ["ESTOP"]


async def test_a_flood_of_tokens_stops_the_robot_which_drives_again_after_it() -> None:
    rig = Rig()
    async with rig.supervisor() as hub, rig.lidar(), rig.source():
        await rig.drive(0.5)
        for n in range(1000):
            hub.tell_alive(f"{topics.TELEOP}/{n:04x}", alive=True)
        await rig.pass_time(0.1)
        assert rig.output() == ZERO
        assert rig.newest_status.reasons == ["SOURCE_LOST"]
        await rig.drive(0.5)


async def test_the_estop_of_a_dead_client_stays() -> None:
    rig = Rig()
    async with rig.supervisor(), rig.lidar(), rig.source():
        await rig.drive(0.5)
        client = rig.network.open_joined("client")
        client.publisher(topics.ESTOP).put(PRESSED)
        client.die()
        rig.velocity = ZERO
        await rig.pass_time(10.0)
        assert rig.newest_status.reasons == ["ESTOP"]


async def test_the_status_names_nodes_that_use_the_keys_of_rmw_zenoh_while_they_live() -> None:
    rig = Rig()
    token = "@ros2_lv/0/aa11/0/0/NN/%/%robot/planner"
    async with rig.supervisor() as hub, rig.lidar():
        await rig.pass_time(0.3)
        assert rig.newest_status.rmw_zenoh_nodes == []
        assert hub.foreign_nodes is not None
        for alive, names in ((True, ["/robot/planner"]), (False, [])):
            hub.foreign_nodes.push(LivelinessChange(token, alive, 0.0))
            await rig.pass_time(0.15)
            assert rig.newest_status.rmw_zenoh_nodes == names


async def test_the_status_reports_the_stamp_of_each_sources_newest_command() -> None:
    rig = Rig()
    sent: list[Stamp] = []
    async with rig.supervisor(), rig.lidar():
        publisher = rig.network.open_joined("teleop").publisher(topics.source_cmd_vel("teleop"))
        async with rig.every(0.05, lambda: sent.append(publisher.put(planar_twist(0.0, 0.0)))):
            for _ in range(20):
                await rig.pass_time(0.1)
        times = [rig.newest_status.source_time_ns(name) for name in ("teleop", "joy", "stranger")]
        assert times[0] in {stamp.source_time_ns for stamp in sent[-5:]}
        assert times[1:] == [0, None]


@pytest.mark.parametrize("source_time_ns", [-(2**63), -1, 2**31 * 10**9, 2**63 - 1])
async def test_a_stamp_that_no_ros_time_can_hold_is_reported_as_zero(source_time_ns: int) -> None:
    rig = Rig()
    async with rig.supervisor(), rig.lidar():
        rogue = rig.network.open_joined("rogue")
        numbers = itertools.count(1)

        def put() -> None:
            stamp = Stamp(next(numbers), source_time_ns, b"r" * 16)
            rogue.send(topics.source_cmd_vel("teleop").key, encode(planar_twist(0.0, 0.0)), stamp.pack())

        async with rig.every(0.05, put):
            await rig.pass_time(1.0)
        assert next(source.stamped for source in rig.newest_status.sources)
        assert rig.newest_status.source_time_ns("teleop") == 0


def alternating_s(number: int) -> float:
    return 0.05 * number - 0.15 * (number % 2)


def constant_s(_: int) -> float:
    return 7.0


def slow_s(number: int) -> float:
    return 0.045 * number


@pytest.mark.parametrize(
    ("stamp_s", "problem"),
    [
        (alternating_s, "go back again and again, by up to 0.10 s"),
        (constant_s, "do not change"),
        (slow_s, "run at 0.90 of real time, or their delay grows"),
    ],
)
async def test_stamps_of_commands_that_do_not_run_like_real_time_are_named_while_they_arrive(
    stamp_s: Callable[[int], float], problem: str
) -> None:
    rig, numbers = Rig(), itertools.count(1)
    async with rig.supervisor(), rig.lidar():
        rogue = rig.network.open_joined("rogue")

        def put() -> None:
            number = next(numbers)
            stamp = Stamp(number, round((100.0 + stamp_s(number)) * 1e9), b"r" * 16)
            twist = planar_twist(0.0 if number < 100 else 0.3, 0.0)
            rogue.send(topics.source_cmd_vel("teleop").key, encode(twist), stamp.pack())

        async with rig.every(0.05, put):
            await rig.pass_time(8.0)
        assert rig.newest_status.detail == f"the stamps of teleop's commands {problem}"
        assert rig.output() == ZERO
        await rig.pass_time(3.0)
        assert "stamps" not in rig.newest_status.detail


async def test_a_burst_without_attachments_moves_nothing() -> None:
    """Thirty commands with a neutral among them, as a bridge delivers them after a stall."""
    rig = Rig()
    key = topics.source_cmd_vel(topics.TELEOP).key
    async with rig.supervisor(), rig.lidar():
        await rig.pass_time(0.5)
        for velocity in [(0.0, 0.0)] * 10 + [(0.4, 0.0)] * 20:
            rig.outsider.send(key, encode(planar_twist(*velocity)), None)
        for _ in range(20):
            await rig.pass_time(0.02)
            assert rig.output() == ZERO
        assert rig.newest_status.reasons == ["NO_COMMAND"]


async def test_a_source_without_attachments_is_served_and_shown_as_such() -> None:
    rig = Rig()
    key = topics.source_cmd_vel(topics.TELEOP).key
    async with rig.supervisor(), rig.lidar():
        for velocity in [(0.0, 0.0)] * 10 + [(0.4, 0.0)] * 10:
            rig.outsider.send(key, encode(planar_twist(*velocity)), None)
            await rig.pass_time(0.05)
        assert rig.output() == (0.4, 0.0)
        await rig.pass_time(0.1)
        (teleop,) = [s for s in rig.newest_status.sources if s.name == topics.TELEOP]
        assert not teleop.stamped
        assert teleop.liveliness == SourceStatus.UNKNOWN


async def test_a_stranger_is_shown_by_name_and_moves_nothing() -> None:
    rig = Rig()
    async with rig.supervisor(), rig.lidar(), rig.source("stranger"):
        rig.velocity = (0.5, 0.0)
        await rig.pass_time(1.0)
        assert rig.newest_status.unknown_sources == ["stranger"]
        assert rig.output() == ZERO


async def test_estop_false_does_nothing() -> None:
    rig = Rig()
    async with rig.supervisor(), rig.lidar(), rig.source():
        await rig.drive(0.5)
        rig.network.open_joined("button").publisher(topics.ESTOP).put(RELEASED)
        await rig.pass_time(0.1)
        assert rig.output() == (0.5, 0.0)


async def test_a_reset_answers_and_moves_nothing() -> None:
    rig = Rig()
    async with rig.supervisor(), rig.lidar(), rig.source():
        await rig.drive(0.5)
        rig.outsider.publisher(topics.ESTOP).put(PRESSED)
        await rig.pass_time(0.1)
        refused = await rig.outsider.call(topics.SUPERVISOR_RESET)
        assert not refused.success
        rig.velocity = ZERO
        await rig.pass_time(0.1)
        granted = await rig.outsider.call(topics.SUPERVISOR_RESET)
        assert granted.success
        rig.cmd_vel.take()
        await rig.pass_time(1.0)
        assert all(o.message == planar_twist(0.0, 0.0) for o in rig.cmd_vel.take())
        assert rig.newest_status.mode == SafetyStatus.READY


async def test_when_it_is_stopped_it_commands_zero_and_withdraws_its_token() -> None:
    rig = Rig()
    async with rig.lidar(), rig.source():
        async with rig.supervisor() as supervisor:
            await rig.drive(0.5)
        await rig.pass_time(0.001)
        assert rig.output() == ZERO
        assert supervisor.own == []


async def test_a_restarted_supervisor_moves_nothing_until_neutral() -> None:
    rig = Rig()
    async with rig.lidar(), rig.source():
        async with rig.supervisor():
            await rig.drive(0.5)
        async with rig.supervisor():
            rig.cmd_vel.take()
            await rig.pass_time(2.0)
            assert all(o.message == planar_twist(0.0, 0.0) for o in rig.cmd_vel.take())
            await rig.drive(0.5)


async def test_a_supervisor_held_up_between_deciding_and_saying_so_reports_how_old_its_word_is(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rig, held_up_s = Rig(), 0.5
    assert isinstance(rig.loop, VirtualLoop)
    loop, decide = rig.loop, service.step
    async with rig.supervisor(), rig.lidar(), rig.source():
        await rig.drive(0.5)

        def held_up(state: State, now_s: float, inputs: Inputs) -> tuple[State, Decision]:
            decided = decide(state, now_s, inputs)
            if decided[1].output != state.base.output:
                monkeypatch.setattr(service, "step", decide)
                loop.advance(held_up_s)
            return decided

        monkeypatch.setattr(service, "step", held_up)
        monkeypatch.setattr(service, "foreseen", nothing_foreseen)  # a command that waits for its step
        rig.velocity = (0.25, 0.0)
        await rig.pass_time(held_up_s + 0.1)
        before = planar_twist(0.5, 0.0)
        said, then, *_ = itertools.dropwhile(lambda a: a.message == before, rig.cmd_vel.take())
    assert said.message == planar_twist(0.25, 0.0)
    assert said.stamp is not None
    assert said.arrival_s - said.stamp.sent().source_time_s == pytest.approx(held_up_s + HOP_S)
    assert then.message == planar_twist(0.0, 0.0)


@pytest.mark.parametrize("flood_hz", [20.0, 1000.0])
async def test_two_writers_of_odometry_are_a_conflict_until_one_is_silent_even_if_one_floods(
    flood_hz: float,
) -> None:
    rig = Rig()
    resting = odometry((0.0, 0.0, 0.0), ZERO)
    wheels, other = (rig.network.open_joined(name).publisher(topics.ODOM) for name in ("wheels", "other"))
    async with rig.supervisor(), rig.lidar(), rig.source(), rig.every(0.05, lambda: wheels.put(resting)):
        await rig.pass_time(1.0)
        assert rig.newest_status.reasons == []
        async with rig.every(1.0 / flood_hz, lambda: other.put(resting)):
            await rig.pass_time(1.0)
            assert rig.newest_status.causes == ["SENSOR_CONFLICT"]
            assert rig.newest_status.detail.startswith("samples come from several writers: odometry: ")
        await rig.pass_time(1.0)
        assert rig.newest_status.causes == []


async def test_odometry_that_is_not_finite_displaces_none_and_is_no_writer() -> None:
    rig = Rig()
    wheels, broken = (rig.network.open_joined(name).publisher(topics.ODOM) for name in ("wheels", "broken"))

    def speak() -> None:
        wheels.put(odometry((0.0, 0.0, 0.0), ZERO))
        broken.put(odometry((0.0, 0.0, 0.0), (math.nan, 0.0)))

    async with rig.supervisor(), rig.lidar(), rig.source(), rig.every(0.05, speak):
        await rig.pass_time(1.0)
        assert rig.newest_status.reasons == []


@pytest.mark.parametrize("stamps", STAMPS)
async def test_scans_whose_headers_do_not_run_like_real_time_are_stale_for_a_reason_that_is_named(
    stamps: str,
) -> None:
    rig = Rig()
    lidar, jitter = rig.network.open_joined("bridge"), itertools.cycle((0.0, 1e-4))

    def put() -> None:
        scan = laser_scan(np.full(360, 3.0) + next(jitter))
        now_ns = round((1.7e9 + rig.loop.time()) * SECOND_NS)
        scan.header.stamp = Time(*divmod(STAMPS[stamps](now_ns), SECOND_NS))
        lidar.send(topics.SCAN.key, encode(scan), None)

    async with rig.supervisor(), rig.source(), rig.every(0.05, put):
        await rig.pass_time(6.7)
        status = rig.newest_status
    assert status.causes == ["SCAN_STALE"]
    more = ", or their delay grows" if stamps == "slow" else ""
    assert status.detail == f"the stamps of the lidar's scans {PROBLEMS[stamps]}{more}"
