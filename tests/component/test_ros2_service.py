"""The ROS 2 process between a node without ROS, the supervisor and a virtual clock: what it passes on, and when not."""

import asyncio
import time
from collections.abc import AsyncGenerator, Mapping
from contextlib import asynccontextmanager

import pytest

from ros2 import service
from ros2.ros import TWIST, TWIST_STAMPED, Endpoint, Level
from tests.component.ros2_rig import BASE, CMD_VEL, ODOM, OWN, SCAN, TELEOP, Ros2Robot
from tests.unit.ros2.programs import Program
from virtual.loop import VirtualLoop
from wire import cdr, topics
from wire.cdr import STANDSTILL
from wire.messages import Bool, LaserScan, Odometry, decode, encode, odometry

STEADY: dict[str, object] = {"name": "teleop", "topic": "teleop/cmd_vel"}
KEYBOARD: dict[str, object] = {**STEADY, "hold_s": 0.6}
REQUESTED: dict[str, object] = {**STEADY, "arm": "on_request"}
A = Endpoint("/a", TWIST, b"a process   " + b"0001")
B = Endpoint("/b", TWIST, b"b process   " + b"0001")
TELEOP_KEY = topics.source_cmd_vel("teleop").key


@asynccontextmanager
async def supervised(
    source: Mapping[str, object], *, stamped: bool = False, stamp: str | None = None
) -> AsyncGenerator[Ros2Robot]:
    """A robot with a supervisor; one program publishes for its source."""
    robot = Ros2Robot(source, stamped=stamped, stamp=stamp)
    robot.discover(A)
    async with robot.rig.supervisor(), robot.running():
        yield robot


def served(robot: Ros2Robot) -> bool:
    return "teleop" in robot.session.bus.own


# --- the base


async def test_without_a_supervisor_zero_is_published_50_times_a_second() -> None:
    async with Ros2Robot().running() as robot:
        outputs = await robot.pass_time(2.0)
        assert 98 <= len(outputs) <= 102
        assert set(outputs) == {STANDSTILL}


async def test_the_supervisors_commands_are_published_once_each_while_the_robot_drives() -> None:
    async with supervised(STEADY) as robot:
        await robot.drive()
        outputs = await robot.pass_time(2.0)
        assert set(outputs) == {(0.5, 0.0)}
        assert 98 <= len(outputs) <= 2 * 60


async def test_a_supervisor_that_dies_stops_the_robot_at_once_and_its_next_run_needs_a_neutral() -> None:
    robot = Ros2Robot(STEADY)
    robot.discover(A)
    async with robot.running():
        async with robot.rig.supervisor() as supervisor:
            await robot.drive()
            supervisor.die()
            outputs = await robot.pass_time(0.01)
            assert outputs[-1] == STANDSTILL
            outputs = await robot.pass_time(1.0)
            assert set(outputs) == {STANDSTILL}
            assert 48 <= len(outputs) <= 52
        async with robot.rig.supervisor():
            assert set(await robot.pass_time(2.0)) == {STANDSTILL}
            await robot.drive()


async def test_a_silent_supervisor_with_a_token_stops_the_robot_after_the_timeout() -> None:
    robot = Ros2Robot(STEADY)
    robot.discover(A)
    async with robot.rig.supervisor() as supervisor, robot.running():
        await robot.drive()
        robot.rig.network.link(topics.SUPERVISOR)[0].loss = 1.0
        assert topics.SUPERVISOR in supervisor.own
        outputs = await robot.pass_time(1.0)
        moving = [output for output in outputs if output != STANDSTILL]
        assert outputs[len(moving) :] == [STANDSTILL] * (len(outputs) - len(moving))
        assert 0.1 <= len(moving) * 0.02 <= 0.18
        assert 40 <= len(outputs) <= 60
        robot.rig.network.link(topics.SUPERVISOR)[0].loss = 0.0


async def test_a_flapping_token_of_the_supervisor_stops_the_robot_until_its_next_command() -> None:
    async with supervised(STEADY) as robot:
        await robot.drive()
        robot.rig.network.flap(topics.SUPERVISOR)
        outputs = await robot.pass_time(0.2)
        assert STANDSTILL in outputs[:3]
        assert outputs[-1] == (0.5, 0.0)


async def test_after_a_suspend_nothing_of_before_moves_the_robot() -> None:
    async with supervised(STEADY) as robot:
        await robot.drive()
        robot.suspended_s = 60.0
        outputs = await robot.pass_time(0.16)
        assert set(outputs[1:]) == {STANDSTILL}


async def test_a_base_that_listens_to_twist_stamped_receives_it() -> None:
    robot = Ros2Robot(STEADY, stamped=True)
    async with robot.running():
        await robot.pass_time(0.1)
    payloads = robot.node.published[CMD_VEL]
    assert payloads
    assert {cdr.twist_of(payload, stamped=True) for payload in payloads} == {cdr.twist(STANDSTILL)}


async def test_the_end_publishes_zero_and_withdraws_all_tokens() -> None:
    robot = Ros2Robot(STEADY)
    robot.discover(A)
    async with robot.rig.supervisor():
        async with robot.running():
            await robot.drive()
            nodes = [name.partition("/")[0] for name in robot.session.bus.own]
            assert nodes == [topics.ROS2, topics.ROS2, "teleop", "teleop"]
        assert robot.outputs()[-1] == STANDSTILL
        assert robot.session.bus.own == []


@pytest.mark.parametrize("topic", ["/diagnostics", "/lifeline/status"])
async def test_an_exception_ends_the_process_with_zero_and_without_tokens(topic: str) -> None:
    robot = Ros2Robot(STEADY)
    robot.discover(A)

    def refuse(published: str, _: bytes) -> None:
        if published == topic:
            raise OSError("no memory")

    async def drive() -> None:
        async with robot.running():
            await robot.drive()
            robot.node.on_publish = refuse
            await robot.pass_time(2.0)

    async with robot.rig.supervisor():
        with pytest.raises(OSError, match="no memory"):
            await drive()
        assert robot.outputs()[-1] == STANDSTILL
        assert robot.session.bus.own == []


# --- the sources


async def test_a_source_is_alive_exactly_while_one_program_publishes() -> None:
    robot = Ros2Robot(STEADY)
    async with robot.running():
        for listed, alive in (((), False), ((A,), True), ((A, B), False), ((B,), True), ((), False)):
            robot.discover(*listed)
            await robot.pass_time(0.03)
            assert served(robot) is alive


async def test_of_two_programs_none_is_obeyed_and_both_are_named() -> None:
    async with supervised(STEADY) as robot:
        await robot.drive()
        robot.discover(A, B)
        await robot.pass_time(0.05)
        sent = len(robot.session.sent[TELEOP_KEY])
        assert set(await robot.pass_time(1.0)) == {STANDSTILL}
        assert len(robot.session.sent[TELEOP_KEY]) == sent
        assert robot.rig.newest_status.reasons[0] == "SOURCE_LOST"
        report = robot.node.report("source teleop")
        assert report.level is Level.ERROR
        assert report.message.startswith("/a and /b all publish on /teleop/cmd_vel")
        robot.discover(A)
        assert set(await robot.pass_time(1.0)) == {STANDSTILL}, "it must send zero first"
        await robot.drive()


async def test_another_program_in_the_place_of_the_first_is_another_source() -> None:
    """As if one publisher was destroyed and another one created between two looks."""
    async with supervised(KEYBOARD) as robot:
        await robot.pass_time(1.0)
        assert robot.rig.newest_status.reasons == []
        changes = robot.rig.outsider.watch_alive()
        changes.take()
        robot.discover(B)
        robot.program, robot.velocity = Program(), (0.5, 0.0)
        assert set(await robot.pass_time(5.0)) == {STANDSTILL}
        assert [(change.node, change.alive) for change in changes.take()] == [
            ("teleop", False),
            ("teleop", True),
        ]


async def test_a_message_that_arrives_before_its_match_begins_the_source() -> None:
    robot = Ros2Robot(STEADY)
    async with robot.running():
        await robot.pass_time(0.1)
        robot.node.listed[TELEOP] = [A]  # discovery knows it, and the node has not reported it yet
        robot.say(0.0)
        await robot.pass_time(0.001)
        assert served(robot)
        assert len(robot.session.sent[TELEOP_KEY]) == 1


async def test_a_steady_program_passes_with_its_own_stamps() -> None:
    robot = Ros2Robot(STEADY)
    robot.discover(A)
    async with robot.running():
        robot.velocity = (0.25, 0.0)
        await robot.pass_time(0.5)
    stamps = [stamp for _, stamp in robot.session.sent[TELEOP_KEY]]
    assert [stamp.sequence for stamp in stamps] == list(range(1, len(stamps) + 1))
    assert len({stamp.gid for stamp in stamps}) == 1
    assert all(stamp.source_time_ns > 1.6e18 for stamp in stamps)


async def test_a_held_key_drives_and_the_robot_stops_after_its_release() -> None:
    async with supervised(KEYBOARD) as robot:
        await robot.pass_time(1.2)
        assert robot.rig.newest_status.reasons == []
        robot.say(0.5)  # the first event of a run proves nothing yet
        await robot.pass_time(0.5)
        robot.velocity = (0.5, 0.0)
        await robot.pass_time(1.0)
        assert set(await robot.pass_time(3.0)) == {(0.5, 0.0)}
        robot.velocity = None
        outputs = await robot.pass_time(2.0)
        moved = [place for place, output in enumerate(outputs) if output != STANDSTILL]
        assert 0.5 <= moved[-1] * 0.02 <= 0.6 + 0.2
        assert robot.rig.newest_status.reasons == []
        robot.say(0.5)
        outputs = await robot.pass_time(0.1)
        assert outputs[-1] == (0.5, 0.0)


async def test_a_burst_of_old_key_events_moves_nothing() -> None:
    async with supervised(KEYBOARD) as robot:
        await robot.pass_time(1.2)
        robot.say(0.5)
        await robot.pass_time(0.5)
        robot.say(0.0)
        await robot.pass_time(3.0)
        for late_s in (2.0, 1.5, 1.0, 0.5, 0.25):
            robot.say(0.5, late_s=late_s)
        assert set(await robot.pass_time(2.0)) == {STANDSTILL}


async def test_a_process_that_hangs_does_not_arm_a_streaming_program() -> None:
    async with supervised(KEYBOARD) as robot:
        await robot.pass_time(1.2)
        robot.say(0.5)
        await robot.pass_time(0.5)
        robot.velocity = (0.5, 0.0)
        outputs = await robot.pass_time(1.0)
        assert outputs[-1] == (0.5, 0.0)
        loop = asyncio.get_running_loop()
        assert isinstance(loop, VirtualLoop)
        loop.advance(0.7)
        await robot.pass_time(0.3)
        assert set(await robot.pass_time(5.0)) == {STANDSTILL}


# --- the token of `lifeline ros2 exec`


async def test_a_killed_program_of_a_wrapper_stops_the_robot_at_once_and_its_next_run_drives() -> None:
    async with supervised(STEADY) as robot:
        wrapper = robot.rig.network.open_joined("exec")
        token = wrapper.declare_alive(f"teleop{topics.EXEC_SUFFIX}")
        wrapper.declare_alive(f"unknown{topics.EXEC_SUFFIX}")
        await robot.drive()
        assert "lifeline ros2 exec" in robot.node.report("source teleop").message
        token.withdraw()
        outputs = await robot.pass_time(0.01)
        assert outputs[-1] == STANDSTILL
        assert not served(robot)
        robot.discover(A, B)  # the dead one is still listed
        await robot.pass_time(0.1)
        robot.program = Program()
        await robot.drive()


async def test_a_program_of_a_wrapper_is_served_again_after_the_hub_was_lost() -> None:
    async with supervised(STEADY) as robot:
        wrapper = robot.rig.network.open_joined("exec")
        wrapper.declare_alive(f"teleop{topics.EXEC_SUFFIX}")
        await robot.drive()
        robot.rig.network.flap(f"teleop{topics.EXEC_SUFFIX}")
        await robot.pass_time(0.001)
        assert not served(robot)
        await robot.pass_time(0.1)
        assert served(robot)
        assert set(await robot.pass_time(1.0)) == {STANDSTILL}, "it must send zero first"
        await robot.drive()


# --- requests


async def test_arm_sends_one_neutral_for_a_program_that_never_does() -> None:
    async with supervised(REQUESTED) as robot:
        robot.velocity = (0.5, 0.0)
        assert set(await robot.pass_time(2.0)) == {STANDSTILL}
        assert await robot.request("/lifeline/arm") == (True, "sent zero velocity for teleop")
        assert (await robot.pass_time(0.2))[-1] == (0.5, 0.0)


@pytest.mark.parametrize("listed", [(), (A, B)])
async def test_arm_does_nothing_unless_one_program_publishes(listed: tuple[Endpoint, ...]) -> None:
    robot = Ros2Robot(REQUESTED)
    robot.discover(*listed)
    async with robot.running():
        await robot.pass_time(0.1)
        assert await robot.request("/lifeline/arm") == (
            False,
            "no program publishes on the topic of such a source",
        )
        assert TELEOP_KEY not in robot.session.sent


async def test_arm_does_nothing_for_sources_that_send_zero_themselves() -> None:
    for sources in ([], [STEADY, {**KEYBOARD, "name": "joy", "topic": "joy"}]):
        robot = Ros2Robot(*sources)
        robot.discover(A)
        async with robot.running():
            await robot.pass_time(0.1)
            success, message = await robot.request("/lifeline/arm")
        assert not success
        assert 'no source has arm = "on_request"' in message


async def test_reset_reaches_the_supervisor_and_names_its_absence() -> None:
    robot = Ros2Robot(STEADY)
    robot.discover(A)
    async with robot.running():
        success, message = await robot.request("/lifeline/reset")
        assert not success
        assert "nobody answered supervisor/reset within 1 s" in message
        async with robot.rig.supervisor():
            robot.velocity = (0.0, 0.0)
            await robot.pass_time(0.5)
            robot.hear("/estop", Program().sample(cdr.TRUE, robot.now_s))
            await robot.pass_time(0.1)
            assert robot.rig.newest_status.reasons == ["ESTOP"]
            success, _ = await robot.request("/lifeline/reset")
            assert success
            await robot.pass_time(0.2)
            assert robot.rig.newest_status.reasons == []


def test_a_request_is_answered_on_the_thread_of_the_node() -> None:
    async def run() -> tuple[bool, str]:
        robot = Ros2Robot()
        return await asyncio.to_thread(robot.node.services["/lifeline/arm"])

    success, message = asyncio.run(run())
    assert not success
    assert "on_request" in message


def test_a_request_that_was_not_answered_in_time_arms_nothing_later(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(service, "REQUEST_LIMIT_S", 0.0)

    async def run() -> Ros2Robot:
        robot = Ros2Robot(REQUESTED)
        robot.discover(A)
        async with robot.running():
            for _ in range(20):
                await asyncio.sleep(0)
            assert served(robot)
            answer = robot.node.services["/lifeline/arm"]()  # the loop hangs meanwhile
            assert answer == service.LATE
            for _ in range(10):
                await asyncio.sleep(0)
        return robot

    robot = asyncio.run(run())
    assert TELEOP_KEY not in robot.session.sent
    assert robot.node.services["/lifeline/arm"]() == service.LATE, "the loop has closed"


# --- sensors and the e-stop


async def test_scans_and_odometry_pass_unchanged_with_the_stamps_of_their_writer() -> None:
    robot = Ros2Robot()
    scans = robot.rig.outsider.subscribe(topics.SCAN, depth=100)
    odometries = robot.rig.outsider.subscribe(topics.ODOM, depth=100)
    async with robot.running():
        driver = Program()
        robot.hear(ODOM, driver.sample(encode(odometry((1.0, 2.0, 0.0), (0.5, 0.1))), robot.now_s, 0.01))
        await robot.pass_time(0.22)
    (heard,) = odometries.take()
    assert isinstance(heard.message, Odometry)
    assert heard.message.twist.twist.linear.x == 0.5
    assert heard.stamp is not None
    assert heard.stamp.source_time_ns == pytest.approx((driver.clock_s - 0.01) * 1e9, abs=1e3)
    arrived = scans.take()
    assert len(arrived) == 5
    assert all(isinstance(one.message, LaserScan) and one.stamp is not None for one in arrived)
    assert len({one.stamp.gid for one in arrived if one.stamp is not None}) == 1
    assert [one.stamp.sequence for one in arrived if one.stamp is not None] == [1, 2, 3, 4, 5]


async def test_two_writers_of_the_scan_have_two_identities_and_are_reported() -> None:
    robot = Ros2Robot()
    robot.node.listed[SCAN] = [A._replace(type_name="sensor_msgs/msg/LaserScan")]
    async with robot.running():
        other = Program(sequence=5000)
        for _ in range(40):
            robot.hear(SCAN, other.sample(b"scan", robot.now_s))
            await robot.pass_time(0.05)
        assert robot.node.report("scan scan").message == "2 writers publish on /scan (/a): end all but one"
    assert len({stamp.gid for _, stamp in robot.session.sent[topics.SCAN.key]}) == 2


async def test_a_report_on_a_change_does_not_call_a_sensor_silent() -> None:
    robot = Ros2Robot(STEADY)
    robot.node.listed[SCAN] = [A._replace(type_name="sensor_msgs/msg/LaserScan")]
    async with robot.running():
        await robot.pass_time(2.0)
        for listed in ((A,), (), (A, B)):
            arrays = len(robot.node.arrays)
            robot.discover(*listed)
            await robot.pass_time(0.001)
            assert len(robot.node.arrays) == arrays + 1
            assert robot.node.report("scan scan").level is Level.OK


@pytest.mark.parametrize(
    ("payload", "pressed"),
    [
        (encode(Bool(data=True)), True),
        (encode(Bool(data=False)), False),
        (b"\x00\x01\x00\x03\x00\x00\x00\x00", False),
        (b"\x00\x01\x00\x00\x02", True),
        (b"", True),
        (b"odd", True),
        (bytes(200), True),
    ],
    ids=["true", "false", "padded false", "2", "nothing", "odd", "long"],
)
async def test_only_a_message_that_is_surely_false_does_not_press_the_estop(
    payload: bytes,
    pressed: bool,  # noqa: FBT001
) -> None:
    robot = Ros2Robot()
    async with robot.running():
        robot.hear("/estop", Program().sample(payload, robot.now_s))
        await robot.pass_time(0.1)
    sent = robot.session.sent.get(topics.ESTOP.key, [])
    assert len(sent) == (3 if pressed else 0), "from each of the three subscriptions"
    assert all(decode(one, Bool).data for one, _ in sent)


# --- reports


async def test_the_mode_is_published_with_each_status_and_once_when_the_supervisor_falls_silent() -> None:
    robot = Ros2Robot(STEADY)
    async with robot.running():
        await robot.pass_time(1.0)
        assert robot.node.statuses == []
        async with robot.rig.supervisor() as supervisor:
            await robot.pass_time(2.0)
            assert 18 <= len(robot.node.statuses) <= 26
            assert robot.node.statuses[-1].message.startswith("STOPPED (")
            supervisor.die()
        robot.node.statuses.clear()
        await robot.pass_time(0.4)
        assert robot.node.statuses == []
        await robot.pass_time(2.0)
        assert [status.message for status in robot.node.statuses] == [
            "the supervisor is silent: the robot is stopped"
        ]
        assert dict(robot.node.statuses[0].values) == {"base": "SUPERVISOR_LOST"}


async def test_all_reports_are_published_once_a_second_on_both_sides() -> None:
    robot = Ros2Robot(STEADY)
    async with robot.running():
        await robot.pass_time(2.0)
        robot.node.arrays.clear()
        before = len(robot.session.sent[topics.DIAGNOSTICS.key])
        await robot.pass_time(10.0)
    assert 8 <= len(robot.node.arrays) <= 11
    assert len(robot.session.sent[topics.DIAGNOSTICS.key]) - before == len(robot.node.arrays)
    names = [report.name for report in robot.node.arrays[-1]]
    assert names == ["supervisor", "source teleop", "cmd_vel", "estop", "scan scan", "odom"]


async def test_the_base_is_reported_with_other_publishers_and_types() -> None:
    robot = Ros2Robot()
    async with robot.running():
        await robot.pass_time(0.1)
        assert robot.node.report("cmd_vel").message == "/base listens on /cmd_vel"
        robot.node.listed[CMD_VEL] = [OWN, A]
        robot.node.listening[CMD_VEL] = [BASE._replace(type_name=TWIST_STAMPED)]
        robot.node.matched()
        await robot.pass_time(0.05)
        report = robot.node.report("cmd_vel")
    assert report.level is Level.ERROR
    assert report.message.startswith("/a publishes on /cmd_vel too, bypassing the supervisor")
    assert report.message.endswith("set stamped = true")


async def test_an_undecodable_status_counts_as_none() -> None:
    robot = Ros2Robot()
    async with robot.running():
        robot.session.bus.receive(topics.STATUS.key, b"no status", None)
        await robot.pass_time(1.0)
        assert [status.level for status in robot.node.statuses] == [Level.ERROR]


# --- clocks

AHEAD_S = 5.0
STAMPED: dict[str, object] = {**STEADY, "stamped": True}


def stamps_s(robot: Ros2Robot) -> list[float]:
    """Return the stamps on the base's command topic, less the present time by the wall clock."""
    return [cdr.header_ns_of(payload) * 1e-9 - time.time() for payload in robot.node.published[CMD_VEL]]


async def drive_stamped(robot: Ros2Robot) -> None:
    """Drive with a source without stamps to a base with stamped commands."""
    robot.velocity = (0.0, 0.0)
    await robot.pass_time(0.6)
    robot.velocity = (0.5, 0.0)
    assert (await robot.pass_time(0.5))[-1] == (0.5, 0.0)


async def test_a_base_with_another_clock_gets_its_own_time() -> None:
    async with supervised(STEADY, stamped=True) as robot:
        robot.base_ahead_s = AHEAD_S
        await drive_stamped(robot)
        assert stamps_s(robot)[-1] == pytest.approx(AHEAD_S, abs=1.0)
        await robot.pass_time(1.0)
        report = robot.node.report("cmd_vel")
    assert dict(report.values)["clock"] == "5.00 s ahead of this computer's clock"


@pytest.mark.parametrize("stamp", ["zero", "now"])
async def test_the_stamp_of_commands_can_be_chosen(stamp: str) -> None:
    async with supervised(STEADY, stamped=True, stamp=stamp) as robot:
        robot.base_ahead_s = AHEAD_S
        await drive_stamped(robot)
        if stamp == "zero":
            assert all(cdr.header_ns_of(payload) == 0 for payload in robot.node.published[CMD_VEL])
        else:
            assert stamps_s(robot)[-1] == pytest.approx(0.0, abs=1.0)
        await robot.pass_time(1.0)
        report = robot.node.report("cmd_vel")
    assert ("ignores each command" in report.message) is (stamp == "now")


async def test_a_step_of_the_bases_clock_stops_the_robot_until_a_neutral_command() -> None:
    async with supervised(STEADY, stamped=True) as robot:
        robot.base_ahead_s = AHEAD_S
        await drive_stamped(robot)
        robot.base_ahead_s = 0.0
        outputs = await robot.pass_time(5.0)
        assert set(outputs[4:]) == {STANDSTILL}
        assert "BASE_UNRESPONSIVE" in robot.rig.newest_status.reasons
        assert "it has changed by -5.00 s" in robot.node.report("cmd_vel").message
        await drive_stamped(robot)
        assert stamps_s(robot)[-1] == pytest.approx(0.0, abs=1.0)


async def test_a_source_with_headers_that_are_10_s_old_moves_nothing_and_is_named() -> None:
    robot = Ros2Robot(STAMPED)
    robot.discover(A._replace(type_name=TWIST_STAMPED))
    robot.header_late_s = 10.0
    async with robot.rig.supervisor(), robot.running():
        robot.velocity = (0.0, 0.0)
        await robot.pass_time(0.6)
        robot.velocity = (0.3, 0.0)
        assert set(await robot.pass_time(2.0)) == {STANDSTILL}
        report = robot.node.report("source teleop")
    assert report.level is Level.ERROR
    assert "10.00 s behind this computer's clock" in report.message


async def test_a_source_with_headers_of_now_drives() -> None:
    robot = Ros2Robot(STAMPED)
    robot.discover(A._replace(type_name=TWIST_STAMPED))
    robot.header_late_s = 0.0
    async with robot.rig.supervisor(), robot.running():
        await drive_stamped(robot)
        await robot.pass_time(1.0)
        assert robot.node.report("source teleop").level is Level.OK
