"""What the robot sends to the supervisor: its scans, its odometry and presses of its e-stop.

Messages pass as bytes, on the node's thread.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from ros2 import ros
from ros2.config import Ros2Section
from ros2.ros import Ros
from ros2.samples import Sample, Writers
from wire import cdr, topics
from wire.stamp import Stamp, Stamper
from wire.zenoh.session import ZenohSession


def new_gid() -> bytes:
    """Return a random identity of a writer (16 bytes)."""
    return Stamper().gid


class Sensor(NamedTuple):
    """A sensor's topic."""

    name: str
    topic: str
    type_name: str
    writers: Writers


class Inputs:
    """Passes scans, odometry and presses of the e-stop to the supervisor.

    Args:
        session: the session, as a client of the supervisor.
        node: the ROS 2 node, which has not started.
        config: `[ros2]`.
        lidar_topics: the wire topics of the lidars, in the order of `[ros2] scan`.
        matched: called on the node's thread when a publisher appears or disappears.
        odometry: called on the node's thread for each odometry of a base that listens to TwistStamped, for its clock.
    """

    def __init__(
        self,
        session: ZenohSession,
        node: Ros,
        config: Ros2Section,
        *,
        lidar_topics: tuple[str, ...],
        matched: Callable[[], None],
        odometry: Callable[[Sample], None],
    ) -> None:
        self._session, self._node, self._config = session, node, config
        self._matched = matched
        self._odometry = odometry
        self.sensors = [
            self._sensor(f"scan {topic}", topic, ros.LASER_SCAN, topics.lidar_scan(on_wire))
            for topic, on_wire in zip(config.scans, lidar_topics, strict=True)
        ]
        self.sensors.append(self._sensor("odom", config.odom, ros.ODOMETRY, topics.ODOM))
        self._estop = session.publisher_raw(topics.ESTOP)
        self.estop_topic = config.resolved(topics.ESTOP.key)
        for quality in ros.Quality:  # a press must arrive from any button, also one before the start
            node.subscribe(self.estop_topic, ros.BOOL, self._on_estop, matched, quality=quality)

    @property
    def epoch(self) -> bytes:
        """The epoch of this run of the process."""
        return self._estop.epoch

    def _sensor(self, name: str, relative: str, type_name: str, to: topics.Topic[Any]) -> Sensor:
        sensor = Sensor(name, self._config.resolved(relative), type_name, Writers(new_gid))
        out = self._session.publisher_raw(to)

        def on_message(sample: Sample) -> None:
            """Pass a message on; called on the node's thread."""
            gid = sensor.writers.gid_of(sample)
            out.put_bytes(sample.payload, Stamp(sample.sequence, sample.source_time_ns, gid).pack())
            if to is topics.ODOM and self._config.stamped:
                self._odometry(sample)

        self._node.subscribe(sensor.topic, type_name, on_message, self._matched)
        return sensor

    def _on_estop(self, sample: Sample) -> None:
        """Press the e-stop; a message that is not a Bool may be a press: unproven means stop."""
        if cdr.bool_of(sample.payload) is not False:
            self._estop.put_bytes(cdr.TRUE)
