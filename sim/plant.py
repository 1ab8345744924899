"""The robot in its world: MuJoCo only, without network, clock or waiting.

The caller controls the simulated time. The same calls give the same trajectory, bit for bit.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from sim import mj
from sim.config import DEFAULT, Build
from sim.drive import Drive, DriveLimits, Twist, WheelGeometry
from sim.floorplan import Circle, Floats, FloorPlan, Outline, Rectangle, Standing, survey, way_out_m
from sim.lidar import Lidar, Ranges
from sim.lidar_config import LidarConfig
from sim.motion_sensors import Axes
from sim.movers import Mover, Placed
from sim.scene import PARKED_Z_M, build, is_inside, pose_of


@dataclass(frozen=True, slots=True)
class Snapshot:
    """The complete state of a plant, including its record of contacts.

    Attributes:
        physics: MuJoCo's integration state, float64.
        sensors: The readings of the last step, float64.
        noise: The state of each lidar's noise generator.
        drive: v and ω of the drive's ramp.
        walked_s: Time in motion of each mover.
        steps_to_tick: Steps until the next update of the movers.
        pillar: Position of the pillar, or None.
        collisions: Number of collisions since the last reset.
        touching: Whether the hull had contact.
        last_contact: Object of the last contact.
    """

    physics: bytes
    sensors: bytes
    noise: tuple[Mapping[str, Any], ...]
    drive: tuple[float, float]
    walked_s: tuple[float, ...]
    steps_to_tick: int
    pillar: tuple[float, float] | None
    collisions: int
    touching: bool
    last_contact: str | None


TICK_STEPS = 10
"""Number of steps between two updates of the movers: in 20 ms, they move by 3 cm at most."""

ONE_LIDAR = (LidarConfig(),)


class Pose(NamedTuple):
    """Pose of a robot's centre in the world; yaw in (-π, π], counter-clockwise from x."""

    x_m: float
    y_m: float
    yaw_rad: float


class Plant:
    """A differential-drive robot with lidars in a scene with static and moving objects, and one movable pillar.

    Args:
        scene: A layout's name, a layout file or an MJCF file; see `scene.build`.
        limits: Limits of the base's drive.
        lidars: Mounts and geometry of the lidars.
        seed: Seed of the lidars' noise.
        options: The robot's hull, payload and grip, and whether there are movers.

    Attributes:
        model: MuJoCo's model of robot and scene.
        data: MuJoCo's state.
        drive: The base's drive: its limits, and the present output of its ramp.
        hull_radius_m: Radius of the smallest circle around the hull.
        size_m: Size of the floor between the walls along x and y, around the origin; None if the walls are unknown.
        start_pose: The robot's pose at the start and after a reset.
        collisions: Number of times since the last reset that the hull came into contact with an object; each bounce counts.
        last_contact: The object of the last collision; None if there was none.
        pillar: Position (x, y) of the pillar in the world in m; None while it is removed.

    Raises:
        SceneError: The scene does not exist or is invalid.
    """

    def __init__(
        self,
        scene: str | Path = DEFAULT,
        limits: DriveLimits | None = None,
        lidars: Sequence[LidarConfig] = ONE_LIDAR,
        seed: int = 0,
        options: Build | None = None,
    ) -> None:
        world = build(scene, options)
        self.model = model = world.model
        self.data = data = mj.make_data(model)
        self.drive = Drive(limits)
        # The first lidar has the same noise as the only lidar of another robot.
        self._lidars = [Lidar(model, one, (seed, n) if n else seed) for n, one in enumerate(lidars)]

        self._qpos, self._qvel, self._ctrl, self._sensors = data.qpos, data.qvel, data.ctrl, data.sensordata
        base = mj.id_of(model, "joint", "robot")
        left, right = mj.id_of(model, "joint", "wheel_left"), mj.id_of(model, "joint", "wheel_right")
        self._base_qpos, self._base_qvel = int(model.jnt_qposadr[base]), int(model.jnt_dofadr[base])
        self._left_qpos, self._right_qpos = int(model.jnt_qposadr[left]), int(model.jnt_qposadr[right])
        self._left_qvel, self._right_qvel = int(model.jnt_dofadr[left]), int(model.jnt_dofadr[right])
        self._left_ctrl = mj.id_of(model, "actuator", "wheel_left")
        self._right_ctrl = mj.id_of(model, "actuator", "wheel_right")
        self._contacts_adr = int(model.sensor_adr[mj.id_of(model, "sensor", "hull_contacts")])
        self._gyro_adr = int(model.sensor_adr[mj.id_of(model, "sensor", "gyro")])
        self._accelerometer_adr = int(model.sensor_adr[mj.id_of(model, "sensor", "accelerometer")])

        self._hull = mj.id_of(model, "geom", "hull")
        self._hull_half_x_m, self._hull_half_y_m, _ = model.geom_size[self._hull].tolist()
        self._is_round = model.geom_type[self._hull] != mj.Shape.BOX
        self.hull_radius_m = (
            self._hull_half_x_m if self._is_round else math.hypot(self._hull_half_x_m, self._hull_half_y_m)
        )
        self.wheels = WheelGeometry(
            radius_m=float(model.geom_size[mj.id_of(model, "geom", "wheel_left"), 0]),
            track_m=2.0 * float(model.body_pos[mj.id_of(model, "body", "wheel_left"), 1]),
        )
        self.timestep_s = float(model.opt.timestep)
        pillar = mj.id_of(model, "geom", "pillar")
        self.pillar_radius_m = float(model.geom_size[pillar, 0])
        self._pillar_half_height_m = float(model.geom_size[pillar, 1])
        self._pillar_pos = data.mocap_pos[model.body_mocapid[mj.id_of(model, "body", "pillar")]]

        self.size_m = world.size_m
        self._floor_plan = FloorPlan(world.standing)
        self._moving_geoms = [geom for geom in world.moving_geoms if geom != pillar]
        self._odd_geoms = world.odd_geoms
        # MuJoCo's poses are those at the beginning of the last step; mocap and static bodies are not affected.
        self._lags = bool(self._odd_geoms) or any(
            model.body_mocapid[model.geom_bodyid[geom]] < 0 for geom in self._moving_geoms
        )
        self._movers = world.movers
        self._mover_ids = [int(model.body_mocapid[mj.id_of(model, "body", m.name)]) for m in self._movers]
        self._walked_s = [0.0] * len(self._movers)
        self._placed = [mover.placed(0.0) for mover in self._movers]
        self._steps_to_tick = TICK_STEPS

        mj.reset(model, data)
        mj.forward(model, data)
        self.start_pose = self.true_pose
        self.pillar: tuple[float, float] | None = None
        self._reached: tuple[float, float] | None = None
        self.collisions = 0
        self._touching = False
        self.last_contact: str | None = None
        self.reset()

    @property
    def lidars(self) -> tuple[LidarConfig, ...]:
        return tuple(lidar.config for lidar in self._lidars)

    @property
    def time_s(self) -> float:
        """Simulated time since construction; a reset does not change it."""
        return self.data.time

    @property
    def true_pose(self) -> Pose:
        """The robot's pose in the world."""
        return Pose(*pose_of(self._qpos[self._base_qpos : self._base_qpos + 7].tolist()))

    @property
    def true_velocity(self) -> Twist:
        """The robot's velocity along its own x axis and about its own z axis."""
        vx, vy, _, _, _, omega = self._qvel[self._base_qvel : self._base_qvel + 6].tolist()
        yaw_rad = self.true_pose.yaw_rad
        return Twist(vx * math.cos(yaw_rad) + vy * math.sin(yaw_rad), omega)

    @property
    def wheel_angles_rad(self) -> tuple[float, float]:
        """Angles of the left and the right wheel since the last reset, counted over all turns."""
        return self._qpos.item(self._left_qpos), self._qpos.item(self._right_qpos)

    @property
    def wheel_twist(self) -> Twist:
        """The twist from the wheel speeds; equal to the true twist if the wheels do not slip."""
        return self.wheels.twist(self._qvel.item(self._left_qvel), self._qvel.item(self._right_qvel))

    def imu(self) -> tuple[Axes, Axes]:
        """Readings of an ideal inertial unit between the wheels, in the robot's frame: rates [rad/s], specific force [m/s²].

        They are those at the beginning of the last step. At rest, the specific force is (0, 0, 9.81).
        """
        gx, gy, gz = self._sensors[self._gyro_adr : self._gyro_adr + 3].tolist()
        ax, ay, az = self._sensors[self._accelerometer_adr : self._accelerometer_adr + 3].tolist()
        return (gx, gy, gz), (ax, ay, az)

    @property
    def outline(self) -> Outline:
        """Outline of the hull from above, in the world frame."""
        x_m, y_m, yaw_rad = self.true_pose
        return self._hull_at(x_m, y_m, yaw_rad)

    @property
    def hull_contacts(self) -> int:
        """Number of contact points of the hull after the last step, without the floor."""
        return int(self._sensors[self._contacts_adr])

    @property
    def movers(self) -> dict[str, Pose]:
        """Poses of people, forklifts and a placed `pillar` in the world, by name."""
        pillar = {} if self.pillar is None else {"pillar": Pose(*self.pillar, 0.0)}
        places = zip(self._movers, self._placed, strict=True)
        return {mover.name: Pose(*placed[:3]) for mover, placed in places} | pillar

    def step(self, twist_target: tuple[float, float], n_steps: int = 1) -> None:
        """Advance by n_steps of `timestep_s` while the drive follows the target (v in m/s, ω in rad/s)."""
        # The inner loop runs 500 times for each simulated second, so names are looked up before it.
        model, data, step, reading, contacts = (
            self.model,
            self.data,
            mj.step,
            self._sensors.item,
            self._contacts_adr,
        )
        while n_steps > 0:
            if self._steps_to_tick == 0:
                self._tick()
            some = min(n_steps, self._steps_to_tick)
            for _ in range(some):
                if twist_target != self._reached:
                    self._follow(twist_target)
                step(model, data)
                if (reading(contacts) > 0.0) is not self._touching:
                    self._touch()
            n_steps -= some
            self._steps_to_tick -= some

    def scan(self, number: int = 0) -> Ranges:
        """Return a lidar's present ranges in m, shape (beams,); see `lidar_geometry.LidarConfig` for the angles."""
        self._catch_up()
        return self._lidars[number].scan(self.data, *self.true_pose)

    def way_out_m(self, number: int = 0) -> Floats:
        """Return the distance [m] at which each beam of a lidar leaves the hull, shape (beams,)."""
        lidar = self._lidars[number].config
        return way_out_m(self.outline, lidar.x_m, lidar.y_m, lidar.angles_rad + lidar.yaw_rad)

    def clearance_m(self) -> float:
        """Return the smallest horizontal distance from the hull to any other object; ≤ 0 on contact."""
        hull = self.outline
        distance_m = self._floor_plan.nearest(hull).distance_m
        present, odd = self._present()
        distance_m = min(distance_m, FloorPlan(present).nearest(hull).distance_m)
        for geom in odd:
            away_m = mj.geom_distance(self.model, self.data, self._hull, geom, mj.FAR_M, None)
            distance_m = min(distance_m, away_m)
        return distance_m

    def place_pillar(self, x_m: float, y_m: float) -> None:
        """Put the pillar at a place in the world.

        Raises:
            ValueError: The place is not finite, outside the hall, or occupied; the pillar is not moved.
        """
        if not (math.isfinite(x_m) and math.isfinite(y_m)):
            raise ValueError(f"The pillar needs a finite place, not ({x_m}, {y_m}).")
        pillar, place = Circle(x_m, y_m, self.pillar_radius_m), f"The pillar at ({x_m:.2f}, {y_m:.2f}) m"
        if self.size_m is not None and not is_inside(pillar, self.size_m):
            raise ValueError(f"{place} would stand in or beyond the walls.")
        others = [Standing("robot", self.outline), *self._taken(pillar=False)]
        taken = min(self._floor_plan.nearest(pillar), FloorPlan(others).nearest(pillar))
        if taken.distance_m <= 0.0:
            raise ValueError(f"{place} would stand in the {taken.name}.")
        self.pillar = (x_m, y_m)
        self._move_pillar(x_m, y_m, self._pillar_half_height_m)

    def remove_pillar(self) -> None:
        """Remove the pillar from the world, if it is there."""
        self.pillar = None
        self._move_pillar(0.0, 0.0, PARKED_Z_M)

    def show(self, pose: tuple[float, float, float]) -> None:
        """Put the robot at a pose for a picture; nothing is checked, and no step may follow."""
        free = self._qpos[self._base_qpos : self._base_qpos + 7]
        free[:2], free[3:] = pose[:2], _turn(pose[2])

    def show_movers(self, movers: Mapping[str, Pose]) -> None:
        """Like `show`, for `movers`; one that is not named stays where it is, but the pillar is removed."""
        for mover, number in zip(self._movers, self._mover_ids, strict=True):
            if mover.name in movers:
                pose = movers[mover.name]
                self.data.mocap_pos[number, :2], self.data.mocap_quat[number] = pose[:2], _turn(pose.yaw_rad)
        self.remove_pillar()
        if "pillar" in movers:
            self._move_pillar(*movers["pillar"][:2], self._pillar_half_height_m)

    def reset(self) -> None:
        """Put the robot at rest at its start and set wheel angles and collisions to zero.

        Time, movers and pillar are not affected.

        Raises:
            ValueError: An object stands on the start; the robot is not moved.
        """
        in_the_way = FloorPlan(self._taken()).nearest(self._hull_at(*self.start_pose))
        if in_the_way.distance_m <= 0.0:
            raise ValueError(f"The robot cannot go back to its start: the {in_the_way.name} stands there.")
        data = self.data
        time_s, mocap_pos, mocap_quat = data.time, data.mocap_pos.copy(), data.mocap_quat.copy()
        mj.reset(self.model, data)
        data.time = time_s
        data.mocap_pos[:], data.mocap_quat[:] = mocap_pos, mocap_quat
        mj.forward(self.model, data)
        self.drive.reset()
        self._reached = None
        self.collisions = 0
        self._touching = False
        self.last_contact = None

    def save(self) -> Snapshot:
        """Return a snapshot of the present state for `restore`."""
        return Snapshot(
            physics=mj.get_state(self.model, self.data).tobytes(),
            sensors=self._sensors.tobytes(),
            noise=tuple(lidar.random.bit_generator.state for lidar in self._lidars),
            drive=self.drive.twist,
            walked_s=tuple(self._walked_s),
            steps_to_tick=self._steps_to_tick,
            pillar=self.pillar,
            collisions=self.collisions,
            touching=self._touching,
            last_contact=self.last_contact,
        )

    def restore(self, snapshot: Snapshot) -> None:
        """Restore a snapshot of this plant, or of another with the same world and lidars; the future is then the same."""
        for lidar, noise in zip(self._lidars, snapshot.noise, strict=True):
            lidar.random.bit_generator.state = noise
        mj.set_state(self.model, self.data, np.frombuffer(snapshot.physics))
        self._sensors[:] = np.frombuffer(snapshot.sensors)
        self.drive.reset(Twist(*snapshot.drive))
        self._reached = None
        self._walked_s = list(snapshot.walked_s)
        self._placed = [
            mover.placed(walked_s) for mover, walked_s in zip(self._movers, self._walked_s, strict=True)
        ]
        self._steps_to_tick = snapshot.steps_to_tick
        self.pillar = snapshot.pillar
        self.collisions, self._touching = snapshot.collisions, snapshot.touching
        self.last_contact = snapshot.last_contact

    def _follow(self, twist_target: tuple[float, float]) -> None:
        """Advance the drive by one step toward the target, and set the wheel speeds."""
        was = self.drive.twist
        twist = self.drive.step(twist_target, self.timestep_s)
        self._ctrl[self._left_ctrl], self._ctrl[self._right_ctrl] = self.wheels.wheel_speeds(twist)
        self._reached = twist_target if twist is was else None

    def _touch(self) -> None:
        """Update contact and collisions when a contact of the hull begins or ends."""
        self._touching = not self._touching
        if self._touching:
            self.collisions += 1
            self.last_contact = self._touched()

    def _touched(self) -> str:
        """Return the name of the object in contact with the hull."""
        for geoms in self.data.contact.geom.tolist():
            if self._hull in geoms:
                return mj.geom_label(self.model, geoms[0] if geoms[1] == self._hull else geoms[1])
        raise AssertionError("a contact of the hull is among the contacts")

    def _tick(self) -> None:
        """Move all movers that are not obstructed."""
        self._steps_to_tick = TICK_STEPS
        if not self._movers:
            return
        x_m, y_m = self._qpos.item(self._base_qpos), self._qpos.item(self._base_qpos + 1)
        dt_s = TICK_STEPS * self.timestep_s
        positions, turns = self.data.mocap_pos, self.data.mocap_quat
        for index, mover in enumerate(self._movers):
            was = self._placed[index]
            if was.way and self._is_hindered(mover, was, x_m, y_m):
                continue
            self._walked_s[index] += dt_s
            now = self._placed[index] = mover.placed(self._walked_s[index])
            number = self._mover_ids[index]
            positions[number, 0], positions[number, 1] = now.x_m, now.y_m
            if now.yaw_rad != was.yaw_rad:
                turns[number, 0], turns[number, 3] = math.cos(0.5 * now.yaw_rad), math.sin(0.5 * now.yaw_rad)

    def _is_hindered(self, mover: Mover, placed: Placed, x_m: float, y_m: float) -> bool:
        """Return whether the robot or the pillar is in a mover's way."""
        in_the_way: list[Standing] = []
        if mover.may_be_hindered(placed, x_m, y_m, self.hull_radius_m):
            in_the_way.append(Standing("robot", self.outline))
        if self.pillar is not None and mover.may_be_hindered(placed, *self.pillar, self.pillar_radius_m):
            in_the_way.append(Standing("pillar", Circle(*self.pillar, self.pillar_radius_m)))
        return bool(in_the_way) and FloorPlan(in_the_way).nearest(mover.looked_at(placed)).distance_m < 0.0

    def _hull_at(self, x_m: float, y_m: float, yaw_rad: float) -> Outline:
        if self._is_round:
            return Circle(x_m, y_m, self._hull_half_x_m)
        return Rectangle(x_m, y_m, yaw_rad, self._hull_half_x_m, self._hull_half_y_m)

    def _present(self) -> tuple[list[Standing], list[int]]:
        """Return the movable objects at their present places, and the solids without a simple outline."""
        self._catch_up()
        present, odd = survey(self.model, self.data, self._moving_geoms)
        if self.pillar is not None:
            present.append(Standing("pillar", Circle(*self.pillar, self.pillar_radius_m)))
        return present, [*self._odd_geoms, *odd]

    def _taken(self, *, pillar: bool = True) -> list[Standing]:
        """Return the occupied parts of the floor, with the whole footprints of the movers."""
        taken = [thing for thing in self._present()[0] if pillar or thing.name != "pillar"]
        for mover, placed in zip(self._movers, self._placed, strict=True):
            taken.append(Standing(mover.name, mover.footprint(placed)))
        return taken

    def _catch_up(self) -> None:
        """Update the poses of bodies from the positions if they are outdated."""
        if self._lags:
            mj.kinematics(self.model, self.data)

    def _move_pillar(self, x_m: float, y_m: float, z_m: float) -> None:
        self._pillar_pos[:] = (x_m, y_m, z_m)
        mj.kinematics(self.model, self.data)  # the next scan must see it even without a step


def _turn(yaw_rad: float) -> tuple[float, float, float, float]:
    """Return the quaternion (w, x, y, z) of a turn about z."""
    return math.cos(0.5 * yaw_rad), 0.0, 0.0, math.sin(0.5 * yaw_rad)
