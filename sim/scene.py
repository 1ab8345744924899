"""The world that is simulated: a layout or an MJCF file, the robot in it, and what can be put in its way.

Nothing of a world that is refused is left behind: everything is checked before the first step.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from sim import hall, mj
from sim.build import DEFAULT, Build, Hull, SceneError
from sim.floorplan import Circle, FloorPlan, Outline, Rectangle, Standing, outline_of, survey
from sim.layout import LAYOUTS, known, read_layout
from sim.lidar import SOLID_GROUP
from sim.movers import Mover
from sim.room import RoomError, check_start, check_things, check_way

MODELS = Path(__file__).with_name("models")
PARKED_Z_M = -100.0
"""Where the pillar waits while it is away."""

_SOLID_BIT = 2
_FLOOR_BIT = 1
_WHEELS = ("wheel_left", "wheel_right")
_PARTS = {
    "joint": ("robot", *_WHEELS),
    "geom": ("hull", *_WHEELS),
    "body": _WHEELS,
    "actuator": _WHEELS,
    "sensor": ("hull_contacts", "gyro", "accelerometer"),
}
"""What the plant asks of a robot."""

_ATTACHED = "lifeline~"
"""Put before the names of what is attached, and taken away again."""


@dataclass(frozen=True, slots=True)
class Scene:
    """A world, ready to be stepped.

    Attributes:
        model: The compiled model; at its first keyframe, or its own poses, the robot stands at its start.
        movers: What goes its own way; each has a mocap body of its name.
        size_m: Of the floor between the walls along x and y, around the origin; None where nobody knows of walls.
        standing: The outlines of what stands still at the hull's height.
        moving_geoms: Solids that move.
        odd_geoms: Solids that stand still, but have no simple outline.
    """

    model: mj.Model
    movers: tuple[Mover, ...]
    size_m: tuple[float, float] | None
    standing: tuple[Standing, ...]
    moving_geoms: tuple[int, ...]
    odd_geoms: tuple[int, ...]


def build(scene: str | Path = DEFAULT, options: Build | None = None) -> Scene:
    """Makes a world.

    Args:
        scene: The name of a layout that comes with the simulation, or a layout file (.toml), or an MJCF file. A body named
            `robot` in an MJCF file is the robot, with the joints, actuators and sensors of `models/robot_round.xml`;
            without one, our robot is put at the site named `robot_start`.
        options: What may differ.

    Raises:
        SceneError: There is no such scene, or something is wrong with it.
    """
    options = options or Build()
    path = _path(scene)
    ways: list[Mover] = []
    size_m: tuple[float, float] | None = None
    try:
        if path.suffix == ".toml":
            layout = read_layout(path)
            spec = hall.spec_of(layout)
            spec.compiler.fusestatic = True  # fewer bodies take a fifth less time
            spec.compiler.discardvisual = not options.scenery
            ways = [mover.mover() for mover in layout.movers]
            size_m = (layout.hall.size_m[0], layout.hall.size_m[1])
        else:
            spec = mj.load_spec(path)
        movers = tuple(ways) if options.moving else ()
        _add_robot(spec, options.hull)
        _equip(spec, options)
        hall.attach(spec, MODELS / "pillar.xml", "pillar", (0.0, 0.0, PARKED_Z_M))
        for mover in movers:
            x_m, y_m, yaw_rad, _ = mover.placed(0.0)
            hall.attach(spec, MODELS / f"{mover.kind}.xml", mover.name, (x_m, y_m, 0.0), yaw_rad)
        return _checked(mj.compile_spec(spec), movers, ways, size_m)
    except ValueError as error:  # a layout's, MuJoCo's while it is put together, or for want of room
        raise SceneError(f"the scene {scene} is refused: {mj.one_line(error)}") from error


def robot_pose(model: mj.Model, data: mj.Data) -> tuple[float, float, float]:
    """Where the robot is: x, y and yaw in (-π, π]."""
    base = int(model.jnt_qposadr[mj.joint_id(model, "robot")])
    return pose_of(data.qpos[base : base + 7].tolist())


def pose_of(qpos: list[float]) -> tuple[float, float, float]:
    """x, y and yaw of a free joint's seven numbers."""
    x_m, y_m, _, qw, qx, qy, qz = qpos
    return x_m, y_m, math.atan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))


def robot_outline(model: mj.Model, data: mj.Data) -> Outline:
    """The hull's outline at the robot's pose; the robot's frame is in its middle."""
    hull = mj.geom_id(model, "hull")
    half_x_m, half_y_m, _ = model.geom_size[hull].tolist()
    x_m, y_m, yaw_rad = robot_pose(model, data)
    if model.geom_type[hull] == mj.Shape.BOX:
        return Rectangle(x_m, y_m, yaw_rad, half_x_m, half_y_m)
    return Circle(x_m, y_m, half_x_m)


def _path(scene: str | Path) -> Path:
    if isinstance(scene, str) and not scene.endswith((".toml", ".xml")):
        if scene not in known():
            raise SceneError(
                f"There is no layout named {scene!r}; there are {', '.join(known())}, and any .toml or .xml file."
            )
        return LAYOUTS / f"{scene}.toml"
    path = Path(scene)
    if path.suffix not in (".toml", ".xml"):
        raise SceneError(f"The scene {path} is neither a layout (.toml) nor an MJCF file (.xml).")
    if not path.is_file():
        raise SceneError(f"There is no scene file {path}.")
    return path


def _add_robot(spec: mj.Spec, hull: Hull) -> None:
    """Puts our robot at its start, unless there is one."""
    if spec.body("robot") is not None:
        return
    site = spec.site("robot_start")
    if site is None:
        raise RoomError(
            "it has no body named 'robot', and no site named 'robot_start' where one could be put"
        )
    if site.parent.name != "world":
        raise RoomError("its site 'robot_start' is not in the world itself but in a body")
    _admit(spec)
    _attach(spec, mj.load_spec(MODELS / f"robot_{hull}.xml"), site)


def _equip(spec: mj.Spec, options: Build) -> None:
    """Checks the robot, and sees to what it carries and how well its wheels grip."""
    for kind, names in _PARTS.items():
        for name in names:
            if getattr(spec, kind)(name) is None:
                raise RoomError(f"its robot has no {kind} named {name!r}; see models/robot_round.xml")
    hull = spec.geom("hull")
    if hull.type not in (mj.Shape.BOX, mj.Shape.CYLINDER) or any(hull.pos[:2]):
        raise RoomError("its robot's hull is no cylinder or box in the middle of the robot")
    if options.payload_kg:
        if not math.isfinite(hull.mass):
            raise RoomError("its robot's hull has no mass of its own, so nothing can be put into it")
        hull.mass += options.payload_kg
    for name in _WHEELS:
        spec.geom(name).friction[0] *= 1.0 - options.wheel_slip


def _admit(spec: mj.Spec) -> None:
    """Makes a world fit for our robot: its physics, a floor that carries, solids that are felt and seen."""
    option = spec.option
    option.timestep, option.impratio = 0.002, 10.0
    option.cone = mj.ELLIPTIC
    option.iterations = option.ls_iterations = 20
    for geom in spec.geoms:
        if not geom.contype and not geom.conaffinity:
            continue
        if geom.type == mj.Shape.PLANE:
            geom.conaffinity |= _FLOOR_BIT
        else:
            geom.conaffinity |= _SOLID_BIT
            geom.group = SOLID_GROUP


def _attach(spec: mj.Spec, child: mj.Spec, site: object) -> None:
    """Puts a child's whole model at a site, under the names that it has there."""
    spec.copy_during_attach = True
    spec.attach(child, prefix=_ATTACHED, site=site)
    for elements in (spec.bodies, spec.geoms, spec.joints, spec.sites, spec.actuators, spec.sensors):
        for element in elements:
            element.name = element.name.removeprefix(_ATTACHED)
    for actuator in spec.actuators:
        actuator.target = actuator.target.removeprefix(_ATTACHED)
    for sensor in spec.sensors:
        sensor.objname = sensor.objname.removeprefix(_ATTACHED)
        sensor.refname = sensor.refname.removeprefix(_ATTACHED)


def _checked(
    model: mj.Model, movers: tuple[Mover, ...], ways: Sequence[Mover], size_m: tuple[float, float] | None
) -> Scene:
    """The scene, if everything in it has room."""
    data = mj.make_data(model)
    mj.reset(model, data)
    mj.forward(model, data)
    solids = [geom for geom in range(model.ngeom) if model.geom_group[geom] == SOLID_GROUP]
    moving = tuple(geom for geom in solids if _moves(model, geom))
    low_m, high_m = _height_m(model, data, mj.geom_id(model, "hull"))
    still = [
        geom
        for geom in solids
        if geom not in moving and _reaches(_height_m(model, data, geom), low_m, high_m)
    ]
    standing, odd = survey(model, data, still)
    if size_m is not None:
        check_things(standing, hall.WALLS, size_m)
    plan = FloorPlan(standing)
    hull = robot_outline(model, data)
    check_start(plan, hull)
    for mover in ways:
        check_way(mover, plan, hull)
    return Scene(model, movers, size_m, tuple(standing), moving, tuple(odd))


def _moves(model: mj.Model, geom: int) -> bool:
    body = model.geom_bodyid[geom]
    return bool(model.body_mocapid[body] >= 0 or model.body_weldid[body] != 0)


def _height_m(model: mj.Model, data: mj.Data, geom: int) -> tuple[float, float]:
    """From where to where an upright geom reaches; one of another shape or tilt may reach anywhere."""
    if outline_of(model, data, geom) is None:
        return -math.inf, math.inf
    half = {mj.Shape.BOX: 2, mj.Shape.CYLINDER: 1, mj.Shape.SPHERE: 0}[mj.Shape(model.geom_type[geom])]
    z_m, half_m = float(data.geom_xpos[geom, 2]), float(model.geom_size[geom, half])
    return z_m - half_m, z_m + half_m


def _reaches(height_m: tuple[float, float], low_m: float, high_m: float) -> bool:
    return height_m[0] < high_m and height_m[1] > low_m
