"""The robot in its warehouse: MuJoCo, and nothing else. No network, no clock, no waiting.

Who steps it decides what time it is. The same calls make the same trajectory, bit for bit.
"""

import math
from pathlib import Path
from typing import NamedTuple

from sim import mj
from sim.drive import Drive, DriveLimits, Twist, WheelGeometry
from sim.floorplan import FloorPlan
from sim.lidar import SOLID_GROUP, Lidar, LidarConfig, Ranges

WAREHOUSE = Path(__file__).with_name("models") / "warehouse.xml"

# The insides of the walls, in the world frame.
HALL_HALF_X_M = 6.0
HALL_HALF_Y_M = 4.0

_PARKED_Z_M = -10.0


class Pose(NamedTuple):
    """Where a robot's centre is and where its front points; yaw in (-π, π], counter-clockwise from x."""

    x_m: float
    y_m: float
    yaw_rad: float


class Odometry(NamedTuple):
    """Dead reckoning from the wheels alone: a pose in the frame of the last reset, and the body twist now."""

    x_m: float
    y_m: float
    yaw_rad: float
    linear_m_s: float
    angular_rad_s: float


class Plant:
    """A round differential-drive robot with a lidar, and one pillar to put in its way.

    Args:
        model_path: The world; it must include the robot and the pillar.
        limits: What the base's drive can do.
        lidar: The lidar's geometry.
        seed: Of the lidar's noise, if it has any.
    """

    def __init__(
        self,
        model_path: Path = WAREHOUSE,
        limits: DriveLimits | None = None,
        lidar: LidarConfig | None = None,
        seed: int = 0,
    ) -> None:
        self.model = mj.load(model_path)
        self.data = mj.make_data(self.model)
        self._drive = Drive(limits)
        self._lidar = Lidar(self.model, lidar, seed)
        model, data = self.model, self.data

        self._qpos, self._qvel, self._ctrl = data.qpos, data.qvel, data.ctrl
        base = mj.joint_id(model, "robot")
        left, right = mj.joint_id(model, "wheel_left"), mj.joint_id(model, "wheel_right")
        self._base_qpos, self._base_qvel = int(model.jnt_qposadr[base]), int(model.jnt_dofadr[base])
        self._left_qpos, self._right_qpos = int(model.jnt_qposadr[left]), int(model.jnt_qposadr[right])
        self._left_qvel, self._right_qvel = int(model.jnt_dofadr[left]), int(model.jnt_dofadr[right])
        self._left_ctrl = mj.actuator_id(model, "wheel_left")
        self._right_ctrl = mj.actuator_id(model, "wheel_right")
        self._contacts_adr = int(model.sensor_adr[mj.sensor_id(model, "hull_contacts")])
        self._sensors = data.sensordata

        hull, pillar = mj.geom_id(model, "hull"), mj.geom_id(model, "pillar")
        self.hull_radius_m = float(model.geom_size[hull, 0])
        self.pillar_radius_m = float(model.geom_size[pillar, 0])
        self.wheels = WheelGeometry(
            radius_m=float(model.geom_size[mj.geom_id(model, "wheel_left"), 0]),
            track_m=2.0 * float(model.body_pos[mj.body_id(model, "wheel_left"), 1]),
        )
        self.timestep_s = float(model.opt.timestep)
        self._pillar_pos = data.mocap_pos[model.body_mocapid[mj.body_id(model, "pillar")]]
        self._pillar_half_height_m = float(model.geom_size[pillar, 1])

        mj.reset_to_keyframe(model, data, 0)
        mj.forward(model, data)
        self.start_pose = self.true_pose
        solids = [g for g in range(model.ngeom) if model.geom_group[g] == SOLID_GROUP and g != pillar]
        self._floor_plan = FloorPlan(model, data, solids)
        self._pillar: tuple[float, float] | None = None
        self._collisions = 0
        self._touching = False
        self._odom_x_m = self._odom_y_m = self._odom_yaw_rad = 0.0
        self._left_rad = self._right_rad = 0.0
        self.reset()

    @property
    def limits(self) -> DriveLimits:
        return self._drive.limits

    @property
    def lidar(self) -> LidarConfig:
        return self._lidar.config

    @property
    def time_s(self) -> float:
        """Simulated time since the construction; a reset does not turn it back."""
        return self.data.time

    @property
    def true_pose(self) -> Pose:
        """The robot's pose in the world."""
        x, y, _, qw, qx, qy, qz = self._qpos[self._base_qpos : self._base_qpos + 7].tolist()
        yaw_rad = math.atan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))
        return Pose(x, y, yaw_rad)

    @property
    def true_velocity(self) -> Twist:
        """The robot's velocity along its own x axis and about its own z axis."""
        vx, vy, _, _, _, omega = self._qvel[self._base_qvel : self._base_qvel + 6].tolist()
        yaw_rad = self.true_pose.yaw_rad
        return Twist(vx * math.cos(yaw_rad) + vy * math.sin(yaw_rad), omega)

    @property
    def drive_twist(self) -> Twist:
        """The twist that the drive's ramp asks of the wheels now."""
        return self._drive.twist

    @property
    def hull_contacts(self) -> int:
        """Contact points of the hull with anything, after the last step; the floor is not among them."""
        return int(self._sensors[self._contacts_adr])

    @property
    def collisions(self) -> int:
        """How often since the last reset the hull went from touching nothing to touching something; a bounce counts anew."""
        return self._collisions

    @property
    def pillar(self) -> tuple[float, float] | None:
        """The pillar's (x, y) in the world in m, or None while it is away."""
        return self._pillar

    def step(self, twist_target: tuple[float, float], n_steps: int = 1) -> None:
        """Moves time on by n_steps of `timestep_s`, the drive following the target (v in m/s, ω in rad/s)."""
        model, data, ctrl, sensors = self.model, self.data, self._ctrl, self._sensors
        for _ in range(n_steps):
            twist = self._drive.step(twist_target, self.timestep_s)
            ctrl[self._left_ctrl], ctrl[self._right_ctrl] = self.wheels.wheel_speeds(twist)
            mj.step(model, data)
            self._reckon()
            touching = sensors.item(self._contacts_adr) > 0.0
            if touching and not self._touching:
                self._collisions += 1
            self._touching = touching

    def odometry(self) -> Odometry:
        """What the wheel encoders say."""
        twist = self.wheels.twist(self._qvel.item(self._left_qvel), self._qvel.item(self._right_qvel))
        return Odometry(self._odom_x_m, self._odom_y_m, self._odom_yaw_rad, *twist)

    def scan(self) -> Ranges:
        """The lidar's ranges now, in m, shape (beams,); see `lidar.LidarConfig` for the angles."""
        return self._lidar.scan(self.data, *self.true_pose)

    def clearance_m(self) -> float:
        """The smallest horizontal distance between the hull and anything else; ≤ 0 when it touches."""
        x_m, y_m, _ = self.true_pose
        distance_m = self._floor_plan.distance_m(x_m, y_m)
        if self._pillar is not None:
            distance_m = min(distance_m, self._to_pillar_m(x_m, y_m, self._pillar))
        return distance_m - self.hull_radius_m

    def place_pillar(self, x_m: float, y_m: float) -> None:
        """Puts the pillar at a place of the world.

        Raises:
            ValueError: The place is not finite, not in the hall, or where the robot is; the pillar stays where it was.
        """
        if not (math.isfinite(x_m) and math.isfinite(y_m)):
            raise ValueError(f"The pillar needs a finite place, not ({x_m}, {y_m}).")
        if max(abs(x_m) - HALL_HALF_X_M, abs(y_m) - HALL_HALF_Y_M) > -self.pillar_radius_m:
            raise ValueError(f"The pillar at ({x_m:.2f}, {y_m:.2f}) m would stand in or beyond the walls.")
        robot = self.true_pose
        if self._to_pillar_m(robot.x_m, robot.y_m, (x_m, y_m)) <= self.hull_radius_m:
            raise ValueError(f"The pillar at ({x_m:.2f}, {y_m:.2f}) m would stand in the robot.")
        self._pillar = (x_m, y_m)
        self._move_pillar(x_m, y_m, self._pillar_half_height_m)

    def remove_pillar(self) -> None:
        """Takes the pillar out of the world; nothing happens if it is not there."""
        self._pillar = None
        self._move_pillar(0.0, 0.0, _PARKED_Z_M)

    def reset(self) -> None:
        """Puts the robot at rest at its start, odometry and collisions at zero; time goes on and the pillar stays.

        Raises:
            ValueError: The pillar stands on the start; the robot stays where it was.
        """
        start_x_m, start_y_m = self.start_pose[:2]
        if (
            self._pillar is not None
            and self._to_pillar_m(start_x_m, start_y_m, self._pillar) <= self.hull_radius_m
        ):
            raise ValueError("The robot cannot go back to its start: the pillar stands there.")
        time_s, pillar_pos = self.data.time, self._pillar_pos.copy()
        mj.reset_to_keyframe(self.model, self.data, 0)
        self.data.time = time_s
        self._pillar_pos[:] = pillar_pos
        mj.forward(self.model, self.data)
        self._drive.reset()
        self._collisions = 0
        self._touching = False
        self._odom_x_m = self._odom_y_m = self._odom_yaw_rad = 0.0
        self._left_rad = self._qpos.item(self._left_qpos)
        self._right_rad = self._qpos.item(self._right_qpos)

    def _reckon(self) -> None:
        """Adds the wheels' increments, as an arc taken at its middle heading."""
        left_rad, right_rad = self._qpos.item(self._left_qpos), self._qpos.item(self._right_qpos)
        forward_m, turn_rad = self.wheels.twist(left_rad - self._left_rad, right_rad - self._right_rad)
        self._left_rad, self._right_rad = left_rad, right_rad
        heading_rad = self._odom_yaw_rad + 0.5 * turn_rad
        self._odom_x_m += forward_m * math.cos(heading_rad)
        self._odom_y_m += forward_m * math.sin(heading_rad)
        self._odom_yaw_rad = math.remainder(self._odom_yaw_rad + turn_rad, math.tau)

    def _to_pillar_m(self, x_m: float, y_m: float, pillar: tuple[float, float]) -> float:
        return math.hypot(x_m - pillar[0], y_m - pillar[1]) - self.pillar_radius_m

    def _move_pillar(self, x_m: float, y_m: float, z_m: float) -> None:
        self._pillar_pos[:] = (x_m, y_m, z_m)
        mj.kinematics(self.model, self.data)  # so that the next scan sees it without a step
