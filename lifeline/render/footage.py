"""Moves a plant as the messages of a robot say: those just heard, or those of a recording or an incident.

The simulator publishes the true pose, and the places of people, forklifts and pillar. A real robot and an incident have odometry only,
which drifts and contains no place in a hall: they are drawn on an open floor.
"""

from collections import deque
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np

from deploy.stack.errors import DeployError
from deploy.stack.launch import Launch
from recordings.incidents.incident import messages
from recordings.record import heard
from recordings.recording import Recorded, RecordingReader
from sim.config import SimSection
from sim.lidar import Ranges
from sim.messages import movers_of
from sim.overlay import Shown
from sim.plant import Plant
from supervisor.blackbox.file import SUFFIX
from teleop.path.course import Pose, placed
from wire.messages import DiagnosticArray, LaserScan, Odometry, SafetyStatus, UndecodableError, decode
from wire.text import printable
from wire.topics import DIAGNOSTICS, ODOM, STATUS, TRUTH, lidar_scan

OPEN = Path(__file__).with_name("open.toml")


class Footage:
    """What the messages of one robot show over time.

    Args:
        robot: which robot it is, for the report.
        launch: its configuration and namespace.
        recorded: the messages.

    Raises:
        DeployError: no message has its pose, or a configuration or a file is refused.
    """

    def __init__(self, robot: str, launch: Launch, recorded: Iterable[Recorded]) -> None:
        sim, prefix = launch.section("sim", SimSection), f"/{launch.bus.namespace}/"
        entries = (TRUTH, ODOM, STATUS, DIAGNOSTICS, *(lidar_scan(one.topic) for one in sim.lidar_configs()))
        self._topics = {prefix + topic.key: topic for topic in entries}
        kept = (message for message in recorded if message.topic in self._topics)
        self._messages = sorted(kept, key=lambda message: message.log_time_ns)
        times_ns = {
            topic: [one.log_time_ns for one in self._messages if one.topic == topic] for topic in self._topics
        }
        self._is_true = bool(times_ns[prefix + TRUTH.key])
        poses_ns = times_ns[prefix + (TRUTH if self._is_true else ODOM).key]
        if not poses_ns:
            raise DeployError(
                f"{robot} has no message on {prefix}{ODOM.key}, so there is no pose to draw: "
                "for a robot of another namespace, give its --config"
            )
        self._begin_ns, self.duration_s = poses_ns[0], (poses_ns[-1] - poses_ns[0]) * 1e-9
        moving = sim.moving and self._is_true and bool(times_ns[prefix + DIAGNOSTICS.key])
        self.sim = sim.model_copy(update={"moving": moving})
        self.scene = sim.scene_beside(launch.config) if self._is_true else str(OPEN)
        self.robot = f"{robot}, by its {'true pose' if self._is_true else 'odometry, which drifts'}"

    def play(self, plant: Plant, times_s: Iterable[float]) -> Iterator[Shown]:
        """Move the plant to each time since the first pose, and yield the state to show."""
        coming = deque(self._messages)
        beams = {lidar.topic: lidar.beams for lidar in plant.lidars}
        ranges: dict[str, Ranges] = {topic: np.empty(0, np.float32) for topic in beams}
        speed_m_s, status, status_ns = 0.0, None, 0
        for now_ns in (self._begin_ns + round(time_s * 1e9) for time_s in times_s):
            while coming and coming[0].log_time_ns <= now_ns:
                one = coming.popleft()
                topic, message = self._topics[one.topic], None
                with suppress(UndecodableError):
                    message = decode(one.payload, topic.type)
                match message:
                    case Odometry() if self._is_true is (topic is TRUTH) and Pose.of(message).is_finite:
                        plant.show(self._in_world(plant, message))
                        speed_m_s = message.twist.twist.linear.x
                    case DiagnosticArray() if self._is_true and (movers := movers_of(message)) is not None:
                        plant.show_movers(movers)
                    case SafetyStatus():
                        status, status_ns = message, one.log_time_ns
                    case LaserScan() if len(message.ranges) == beams[topic.key]:
                        ranges[topic.key] = message.ranges
                    case _:
                        pass
            yield Shown.of(status, (now_ns - status_ns) * 1e-9, speed_m_s, tuple(ranges.values()))

    def _in_world(self, plant: Plant, message: Odometry) -> Pose:
        """Return a pose in the world: odometry begins at the start."""
        pose = Pose.of(message)
        return pose if self._is_true else Pose(*placed(np.array([pose]), Pose(*plant.start_pose))[0].tolist())


def of_robot(launch: Launch, seconds: float) -> Footage:
    """Return what a running robot does in the next seconds; see `Footage` and `heard`."""
    return Footage(f"the running robot at {launch.bus.endpoint}", launch, heard(launch, seconds))


def of_file(launch: Launch, path: Path) -> Footage:
    """Return what a recording or, by the end of its name, a black box shows; see `Footage`."""
    is_black_box = path.name.endswith(SUFFIX)
    recorded = messages(path, launch.bus.namespace) if is_black_box else RecordingReader(path).messages()
    return Footage(printable(str(path)), launch, recorded)
