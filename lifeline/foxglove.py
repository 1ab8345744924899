"""`lifeline foxglove`: serve a robot's messages to Foxglove over a WebSocket. It publishes nothing on the bus.

Every message is forwarded as received, without decoding. Only odometry and some scans are also decoded, for the frames
(robot_drawing.py). The SDK sends on threads of its own, from a queue for each client that drops the oldest messages, so
that neither Zenoh's callbacks nor this loop wait for a client.
"""

import asyncio
import re
import time
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, NoReturn

import foxglove as sdk
from foxglove.channels import FrameTransformsChannel, SceneUpdateChannel
from foxglove.websocket import WebSocketServer

from deploy.stack.errors import DeployError
from deploy.stack.heard_sources import HeardSources
from deploy.stack.launch import Launch
from deploy.stack.listen import bracketed, cannot_listen, is_loopback, parse_listen
from deploy.stack.reach import run_connected
from lifeline.foxglove_messages import scene_message, transforms_message
from lifeline.inspection.keys import known_topics
from lifeline.recording.reader import MESSAGE_ENCODING, SCHEMA_ENCODING
from lifeline.robot_drawing import Frames, outlines
from supervisor.config import SupervisorSection
from wire import topics
from wire.bus import RawArrival, Subscription, wait_until
from wire.host.config import ConfigError, read_toml, section
from wire.host.process import run_process
from wire.messages import (
    MAX_PAYLOAD_BYTES,
    LaserScan,
    Odometry,
    UndecodableError,
    decode,
    definition,
    header,
)
from wire.stamp import Stamp, parse_stamp
from wire.topics import Topic
from wire.zenoh.bus import ZenohBus

LOOK_PERIOD_S = 0.02
DRAWING_PERIOD_S = 1.0
"""How often the hull, the rings and the frames of the lidars are sent; a new client waits this long for them."""
DEPTH = 256
"""Queue depth of each topic: more than a second of the fastest one."""
BACKLOG = 256
"""Maximum number of messages that wait for one client, about one second of all topics; beyond it, the oldest are dropped."""
TRANSFORMS, SCENE = "/tf", "/scene"
"""Topics of the drawing. A robot's topics have at least two parts, so none of them has such a name."""


@dataclass(slots=True)
class Forwarded:
    """A topic of the robot, and its channel."""

    topic: Topic[Any]
    channel: sdk.Channel
    subscription: Subscription[Any] | None = None
    """None until the robot is reached."""


def foxglove(launch: Launch, listen: str) -> NoReturn:
    """Serve the robot until Ctrl-C.

    Raises:
        DeployError: the server cannot listen, or the configuration is refused.
    """
    config = _read(launch)
    context = sdk.Context()
    # Before the server starts: the SDK refuses a client that subscribes at the moment when a channel is added.
    bridge = Bridge(launch, config, context)
    server = start(context, launch.bus.namespace, listen)
    host = parse_listen(listen)[0]

    async def main(stop: asyncio.Event) -> int:
        print(
            f"lifeline: serving ws://{bracketed(host)}:{server.port} to Foxglove; press Ctrl-C to end",
            flush=True,
        )
        if not is_loopback(host):
            print("lifeline: other machines can read the messages, without a password", flush=True)
        await run_connected(launch.bus, stop, lambda bus: bridge.run(bus, stop))
        server.stop()
        return 0

    # No process waits for this command's liveliness token: it has none.
    run_process("lifeline", main)


def start(context: sdk.Context, namespace: str, listen: str) -> WebSocketServer:
    """Start a server that only sends: without capabilities, it refuses messages, parameters and calls from clients.

    Args:
        context: of the channels that it offers.
        namespace: of the robot.
        listen: `HOST:PORT`.

    Raises:
        DeployError: the address is invalid, in use, or not one of this machine.
    """
    host, port = parse_listen(listen)
    # Nothing is logged: clients receive their errors, and no client's text reaches the terminal.
    sdk.set_log_level("CRITICAL")
    try:
        return sdk.start_server(
            name=f"lifeline {namespace}",
            host=host,
            port=port,
            capabilities=[],
            context=context,
            message_backlog_size=BACKLOG,
        )
    except RuntimeError as error:
        # Its text ends with the reason, such as "Failed to bind port: Address already in use (os error 98)".
        reason = str(error).rpartition(": ")[2]
        number = re.search(r" \(os error (\d+)\)$", reason)
        if number is None:
            raise cannot_listen(listen, None, reason) from error
        raise cannot_listen(listen, int(number[1]), reason[: number.start()]) from error


def _read(launch: Launch) -> SupervisorSection:
    """Read `[supervisor]` of the robot.

    Raises:
        DeployError: the file is refused.
    """
    try:
        return section(read_toml(launch.config), "supervisor", SupervisorSection)
    except ConfigError as error:
        raise DeployError(str(error)) from error


class Bridge:
    """Forwards the messages of a robot to the channels of a context, and draws its frames, hull and rings."""

    def __init__(self, launch: Launch, config: SupervisorSection, context: sdk.Context) -> None:
        self._launch, self._context = launch, context
        self._config: SupervisorSection = config
        # One offset for all messages: a step of the wall clock does not reorder them.
        self._wall_ns = time.time_ns() - round(time.monotonic() * 1e9)
        self._frames = Frames(config)
        self._transforms = FrameTransformsChannel(TRANSFORMS, context=context)
        self._scene = SceneUpdateChannel(SCENE, context=context)
        self._forwarded: dict[str, Forwarded] = {}
        self._scans: dict[str, bytes] = {}
        """The last scan of each lidar since the last drawing."""
        self._run: bytes | None = None
        """The run of the supervisor, as in its stamps."""
        self._add_configured()

    async def run(self, bus: ZenohBus, stop: asyncio.Event) -> None:
        """Forward until `stop`."""
        draw_s = time.monotonic()
        strangers = HeardSources(bus.hear_sources(), (source.name for source in self._config.sources))
        while not stop.is_set():
            self._add(map(topics.source_cmd_vel, strangers.take_new()))
            for one in list(self._forwarded.values()):
                if one.subscription is None:
                    one.subscription = bus.subscribe(one.topic, depth=DEPTH)
                for arrival in one.subscription.take_raw():
                    if len(arrival.payload) <= MAX_PAYLOAD_BYTES:
                        self._forward(one, arrival)
            if time.monotonic() >= draw_s:
                draw_s = time.monotonic() + DRAWING_PERIOD_S
                self._draw()
            await wait_until(stop, time.monotonic() + LOOK_PERIOD_S)

    def _forward(self, one: Forwarded, arrival: RawArrival) -> None:
        time_ns = self._time_ns(arrival.arrival_s)
        if one.channel.has_sinks():
            one.channel.log(arrival.payload, log_time=time_ns)
        if one.topic is topics.ODOM:
            self._draw_base(arrival.payload, time_ns)
        elif one.topic is topics.STATUS:
            self._hear_supervisor(parse_stamp(arrival.attachment))
        elif one.topic.type is LaserScan:
            self._scans[one.topic.key] = arrival.payload

    def _draw_base(self, odometry: bytes, time_ns: int) -> None:
        """Send the pose of the base in the odometry's frame."""
        if self._transforms.has_sinks() or self._scene.has_sinks():
            with suppress(UndecodableError):
                transform = self._frames.hear_odometry(decode(odometry, Odometry))
                if transform is not None:
                    self._transforms.log(transforms_message([transform]), log_time=time_ns)

    def _draw(self) -> None:
        """Send the hull, the rings and the frames of the lidars."""
        time_ns = self._time_ns(time.monotonic())
        if self._scene.has_sinks():
            self._scene.log(
                scene_message(outlines(self._config), self._frames.base, time_ns), log_time=time_ns
            )
        if not self._transforms.has_sinks():
            return
        for key, scan in self._scans.items():
            with suppress(UndecodableError):
                self._frames.hear_scan(key, decode(scan, LaserScan).header.frame_id)
        self._scans.clear()
        lidars = list(self._frames.lidars(header("", time_ns).stamp))
        if lidars:
            self._transforms.log(transforms_message(lidars), log_time=time_ns)

    def _hear_supervisor(self, stamp: Stamp | None) -> None:
        """Read the configuration again if another supervisor has started, perhaps with another one."""
        if stamp is None or stamp.gid == self._run:
            return
        self._run = stamp.gid
        with suppress(DeployError):  # it did not start with this file, and the last one still applies
            config = _read(self._launch)
            if config != self._config:
                self._config, self._frames = config, Frames(config)
                self._add_configured()

    def _add_configured(self) -> None:
        sources = (source.name for source in self._config.sources)
        lidars = (lidar.topic for lidar in self._config.all_lidars())
        self._add(known_topics(sources, lidars, self._config.station_names()))

    def _add(self, added: Iterable[Topic[Any]]) -> None:
        """Offer topics to the clients; `run` subscribes to them."""
        for topic in added:
            if topic.key in self._forwarded:
                continue
            msgtype = topic.type.__msgtype__
            schema = sdk.Schema(
                name=msgtype, encoding=SCHEMA_ENCODING, data=definition(msgtype).text.encode()
            )
            name = f"/{self._launch.bus.namespace}/{topic.key}"
            channel = sdk.Channel(
                name, schema=schema, message_encoding=MESSAGE_ENCODING, context=self._context
            )
            self._forwarded[topic.key] = Forwarded(topic, channel)

    def _time_ns(self, monotonic_s: float) -> int:
        return self._wall_ns + round(monotonic_s * 1e9)
