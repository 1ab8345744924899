"""Recordings of robots for these tests: messages of an invented drive or of a real lidar, written as MCAP or by rosbag2."""

import json
import math
from collections.abc import Iterable, Iterator
from itertools import pairwise
from operator import attrgetter
from pathlib import Path
from typing import Any, cast

import numpy as np
from rosbags.interfaces import Connection
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from recordings.recording import Recorded, RecordingWriter
from supervisor.config import SupervisorSection
from tests.unit.supervisor.law.recordings import DATA, Robot
from wire import cdr
from wire import messages as ros

START_NS = 1_700_000_000_000_000_000
TWIST, TWIST_STAMPED = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"
SCAN, ODOM, CMD_VEL = "/scan", "/odom", "/cmd_vel"


def ns(time_s: float) -> int:
    return START_NS + round(time_s * 1e9)


def message(topic: str, time_s: float, one: ros.Message) -> Recorded:
    return Recorded(topic, one.__msgtype__, ns(time_s), 0, ros.encode(one))


def scan(
    time_s: float, ahead_m: float = 3.0, *, noise_m: float = 0.0, beams: int = 360, topic: str = SCAN
) -> Recorded:
    """A round room of 3 m, with a wall of 40 degrees ahead of the lidar."""
    ranges = np.full(beams, 3.0, dtype=np.float32)
    ranges[beams // 2 - 20 : beams // 2 + 21] = ahead_m
    ranges += np.float32(noise_m)
    return message(
        topic, time_s, ros.laser_scan(ranges, range_m=(0.05, 12.0), period_s=0.05, time_ns=ns(time_s))
    )


def odom(time_s: float, v_m_s: float, w_rad_s: float = 0.0, topic: str = ODOM) -> Recorded:
    return message(topic, time_s, ros.odometry((0.0, 0.0, 0.0), (v_m_s, w_rad_s), time_ns=ns(time_s)))


def command(time_s: float, v_m_s: float, *, stamped: bool = False, topic: str = CMD_VEL) -> Recorded:
    if stamped:
        payload = cdr.twist_stamped(cdr.Planar(v_m_s, 0.0), ns(time_s), "base_link")
        return Recorded(topic, TWIST_STAMPED, ns(time_s), 0, payload)
    return message(topic, time_s, ros.planar_twist(v_m_s, 0.0))


def drive(
    seconds: float = 6.0,
    *,
    from_s: float = 1.0,
    speed_m_s: float = 0.4,
    wall_m: float = 20.0,
    silent: tuple[float, float] = (math.inf, math.inf),
    stops: bool = False,
    stamped: bool = False,
) -> Iterator[Recorded]:
    """A robot that drives ahead from `from_s` on, whatever is in its way.

    Args:
        seconds: the length of the recording.
        from_s: the begin of the motion.
        speed_m_s: its speed.
        wall_m: the distance of a wall ahead of the lidar at the beginning.
        silent: a time without commands.
        stops: whether the base stands during the silence.
        stamped: whether the commands are TwistStamped.
    """
    x_m = moves_m_s = 0.0
    for tick in range(round(seconds * 100)):
        time_s = tick / 100
        is_silent = silent[0] <= time_s < silent[1]
        v_m_s = speed_m_s if time_s >= from_s else 0.0
        wanted_m_s = (
            0.0 if (stops and silent[0] <= time_s < silent[1] + 0.05) or time_s < from_s + 0.05 else v_m_s
        )
        moves_m_s += max(-0.01, min(0.01, wanted_m_s - moves_m_s))  # 1 m/s²
        x_m += 0.01 * moves_m_s
        if tick % 5 == 0:
            noise_m = 0.001 * ((tick // 5) % 3)
            yield scan(time_s, min(3.0, max(0.06, wall_m - x_m)), noise_m=noise_m)
        if tick % 2 == 0:
            yield odom(time_s + 0.001, moves_m_s)
        if tick % 5 == 1 and not is_silent:
            yield command(time_s + 0.002, v_m_s, stamped=stamped)


def write_mcap(path: Path, messages: Iterable[Recorded]) -> Path:
    writer = RecordingWriter(path)
    for one in messages:
        if one.msgtype == TWIST_STAMPED:
            one = one._replace(msgtype=TWIST)  # noqa: PLW2901 - the writer knows no definition of it
        writer.write(one)
    writer.close()
    return path


def write_rosbag2(
    folder: Path, messages: Iterable[Recorded], *, storage: StoragePlugin = StoragePlugin.SQLITE3
) -> Path:
    """Write a folder as `ros2 bag record` does; its .db3 file is inside."""
    store = get_typestore(Stores.ROS2_JAZZY)
    with Writer(folder, version=9, storage_plugin=storage) as writer:
        connections: dict[str, Connection] = {}
        for one in messages:
            if one.topic not in connections:
                definition, _ = store.generate_msgdef(one.msgtype, ros_version=2)
                connections[one.topic] = writer.add_connection(
                    one.topic, one.msgtype, msgdef=definition, rihs01=store.hash_rihs01(one.msgtype)
                )
            writer.write(connections[one.topic], one.log_time_ns, one.payload)
    return folder


def real(robot: Robot) -> list[Recorded]:
    """The messages of a recorded lidar, with the odometry and the commands that were recorded with it."""
    data = np.load(DATA / f"{robot.file}.npz")
    stamps_s, end_s = data["stamps"], robot.longest_s
    arrivals_s = data["recv_stamps"] if "recv_stamps" in data else np.sort(stamps_s)
    start_s = float(arrivals_s[0])
    lengths = data["n_beams"] if "n_beams" in data else np.full(len(stamps_s), data["ranges"].shape[1])
    found: list[Recorded] = []
    for row, length, stamp_s, arrival_s in zip(data["ranges"], lengths, stamps_s, arrivals_s, strict=True):
        ranges = np.ascontiguousarray(row[:length], dtype=np.float32)
        one = ros.LaserScan(
            ros.header("laser", ns(float(stamp_s) - start_s)),
            angle_min=float(data["angle_min"]),
            angle_max=float(data["angle_min"] + (length - 1) * data["angle_increment"]),
            angle_increment=float(data["angle_increment"]),
            time_increment=0.0,
            scan_time=0.0,
            range_min=float(data["range_min"]),
            range_max=float(data["range_max"]),
            ranges=ranges,
            intensities=np.empty(0, dtype=np.float32),
        )
        found.append(message(SCAN, float(arrival_s) - start_s, one))
    if "odom" in data:
        names = str(data["odom_cols"]).split(",")
        for before, row in pairwise(data["odom"]):
            values = dict(zip(names, row.tolist(), strict=True))
            if "vx" in values:
                found.append(odom(values["recv"] - start_s, values["vx"], values["wz"]))
            elif row[0] > before[0]:  # only poses: the velocity between two of them, including spikes
                dt_s = float(row[0] - before[0])
                way_m = math.hypot(row[2] - before[2], row[3] - before[3])
                turn_rad = math.remainder(row[4] - before[4], math.tau)
                found.append(odom(values["ipc_stamp"] - start_s, way_m / dt_s, turn_rad / dt_s))
    rows = cast("list[list[float]]", data["cmd_vel"].tolist()) if "cmd_vel" in data else []
    found += [message(CMD_VEL, row[0] - start_s, ros.planar_twist(row[1], row[3])) for row in rows]
    last_ns = ns(end_s) if math.isfinite(end_s) else math.inf
    return sorted((one for one in found if 0 <= one.log_time_ns <= last_ns), key=attrgetter("log_time_ns"))


def configuration(section: SupervisorSection) -> str:
    """The TOML of a configuration: JSON has the same lists, numbers and texts."""

    def text(value: Any) -> str:  # noqa: ANN401 - any value of a configuration
        if isinstance(value, dict):
            items = cast("dict[str, Any]", value).items()
            return "{ " + ", ".join(f"{key} = {text(item)}" for key, item in items if item is not None) + " }"
        return json.dumps(value)

    given = {"deceleration_m_s2": 1.5} | section.model_dump(exclude_unset=True)
    return "[supervisor]\n" + "".join(f"{key} = {text(value)}\n" for key, value in given.items())
