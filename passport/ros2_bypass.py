"""`python -m passport.ros2_bypass`: in place of the process `ros2`, to measure a ROS 2 robot without Lifeline.

It passes scans, odometry and presses of the e-stop on as `ros2` does, and each velocity on `cmd_vel` of the bus to the robot's command topic as it arrives. It
never repeats one, and has no watchdog: when the commands end, only the base's own timeout stops the robot. In a TwistStamped, motion passes only while the
base's clock is known, because the base would keep a command with a wrong stamp for a wrong time. The first line of its stdout is `ready`, or the reason why
it cannot run; it publishes zero and ends when its stdin ends.

Like `ros2`, it runs in an environment with rclpy. It therefore imports nothing of the passport but child.py.
"""

import asyncio
import sys
import time

from passport.child import READY, die_with_parent, stop_with_stdin
from ros2.base_clock import ODOM_DEPTH, BaseClock
from ros2.check_base import MakeNode
from ros2.commands import message
from ros2.config import Ros2Section, SupervisorValues
from ros2.inputs import Inputs
from ros2.program import connect, node_of, read
from ros2.ros import Ros, twist_type
from ros2.samples import Sample
from wire import cdr, topics
from wire.host.command_line import service_parser
from wire.host.config import ConfigError, Sections
from wire.host.process import run_process
from wire.inbox import BusError, Inbox
from wire.zenoh.session import ZenohSession

DEPTH = 32


async def pass_on(
    session: ZenohSession,
    node: Ros,
    config: Ros2Section,
    lidar_topics: tuple[str, ...],
    stop: asyncio.Event,
) -> None:
    """Pass messages in both directions until `stop`, then publish zero.

    Args:
        session: the session, as a client of the hub.
        node: the ROS 2 node, which this starts.
        config: `[ros2]`.
        lidar_topics: the wire topics of the lidars, in the order of `[ros2] scan`.
        stop: ends it.
    """
    wake = asyncio.Event()
    loop = asyncio.get_running_loop()
    clock = BaseClock(config.stamp)
    odometry: Inbox[Sample] = Inbox(ODOM_DEPTH, wake)
    commands: Inbox[bytes] = Inbox(DEPTH, wake)
    inputs = Inputs(
        session,
        node,
        config,
        lidar_topics=lidar_topics,
        matched=lambda: None,
        odometry=odometry.push,
    )
    cmd_vel = node.publisher(
        config.resolved(config.cmd_vel), twist_type(stamped=config.stamped), lambda: None
    )
    session.subscribe_raw(topics.CMD_VEL.key, lambda payload, _attachment, _arrival_s: commands.push(payload))

    def publish(velocity: cdr.Planar) -> None:
        cmd_vel(message(velocity, config, clock.stamp_ns(time.time_ns())))

    tokens = [session.declare_alive(topics.ROS2, epoch) for epoch in (b"", inputs.epoch)]
    stopping = asyncio.ensure_future(stop.wait())
    stopping.add_done_callback(lambda _: wake.set())
    node.start()
    print(READY, flush=True)
    try:
        while not stop.is_set():
            await wake.wait()
            wake.clear()
            for sample in odometry.take():
                clock.hear(sample)
            for payload in commands.take():
                velocity = cdr.planar_of(payload)
                if velocity is not None and (velocity == cdr.STANDSTILL or clock.may_move(loop.time())):
                    publish(velocity)
    finally:
        stopping.cancel()
        publish(cdr.STANDSTILL)
        for token in tokens:
            token.withdraw()


async def _run(stop: asyncio.Event, sections: Sections, make_node: MakeNode) -> int:
    stop_with_stdin(stop)

    async def serve(session: ZenohSession, node: Ros) -> None:
        lidar_topics = sections[SupervisorValues].lidar_topics
        await pass_on(session, node, sections[Ros2Section], lidar_topics, stop)

    try:
        await connect(sections, make_node, serve)
    except BusError as error:
        print(error, flush=True)
        return 1
    return 0


def _main() -> None:
    parser = service_parser("passport.ros2_bypass")
    parser.add_argument("parent", metavar="PID", type=int, help="the process that starts it")
    arguments = parser.parse_args()
    die_with_parent(arguments.parent)
    try:
        sections = read(arguments)
        make_node = node_of(sections)
    except ConfigError as refused:
        print(refused, flush=True)
        sys.exit(1)
    run_process("ros2_bypass", lambda stop: _run(stop, sections, make_node))


if __name__ == "__main__":
    _main()
