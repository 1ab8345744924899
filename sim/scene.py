"""Build the simulated world: a layout or an MJCF file, the robot, and a pillar that can be placed.

Everything is checked before the first step.
"""

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

from sim import hall, mj
from sim.config import DEFAULT, Build, Hull, SceneError
from sim.floorplan import Circle, FloorPlan, Outline, Rectangle, Standing, outline_of, survey
from sim.layout import LAYOUTS, known, read_layout
from sim.lidar import SOLID_GROUP
from sim.movers import Mover

OVERLAP_M = 0.002
"""Tolerance for overlaps of neighbouring objects, because the numbers in files are rounded."""


def check_things(standing: Sequence[Standing], walls: Collection[str], size_m: tuple[float, float]) -> None:
    """Check that no object overlaps a wall or another object.

    Args:
        standing: All objects on the floor, including the walls.
        walls: The names of the walls.
        size_m: Size of the floor between the walls along x and y, around the origin.

    Raises:
        SceneError: An object overlaps; the message names the first one.
    """
    things = [thing for thing in standing if thing.name not in walls]
    for thing in things:
        if not is_inside(thing.outline, size_m, OVERLAP_M):
            raise SceneError(f"{_at(thing)} reaches into or beyond the walls.")
    plan = FloorPlan(things)
    for thing in things:
        others = [other for other in plan.overlapping(thing.outline, OVERLAP_M) if other != thing.name]
        if others:
            raise SceneError(f"{_at(thing)} stands in {others[0]}.")


def check_start(plan: FloorPlan, hull: Outline) -> None:
    """Check that the robot's start is free.

    Raises:
        SceneError: The start is occupied; the message names the object.
    """
    nearest = plan.nearest(hull)
    if nearest.distance_m <= 0.0:
        raise SceneError(f"the robot's start, ({hull.x_m:g}, {hull.y_m:g}) m, is in {nearest.name}.")


def check_way(mover: Mover, plan: FloorPlan, hull: Outline) -> None:
    """Check that a mover's path does not lead through static objects or begin at the robot's start.

    Raises:
        SceneError: The path is not free; the message names the object.
    """
    for taken in mover.swept():
        nearest = plan.nearest(taken)
        if nearest.distance_m < -OVERLAP_M:
            raise SceneError(f"the path of {mover.name} passes through {nearest.name}.")
    first = FloorPlan([Standing("robot", hull)]).nearest(mover.footprint(mover.placed(0.0)))
    if first.distance_m <= 0.0:
        raise SceneError(f"the path of {mover.name} begins where the robot starts.")


def is_inside(outline: Outline, size_m: tuple[float, float], slack_m: float = 0.0) -> bool:
    """Return whether an outline is completely on the floor between the walls, with a tolerance of `slack_m`."""
    half_x_m, half_y_m = 0.5 * size_m[0] + slack_m, 0.5 * size_m[1] + slack_m
    if isinstance(outline, Circle):
        return max(abs(outline.x_m) - half_x_m, abs(outline.y_m) - half_y_m) <= -outline.radius_m
    return all(abs(x_m) <= half_x_m and abs(y_m) <= half_y_m for x_m, y_m in outline.corners_m())


def _at(thing: Standing) -> str:
    return f"{thing.name} at ({thing.outline.x_m:g}, {thing.outline.y_m:g}) m"


PARKED_Z_M = -100.0
"""Height of the removed pillar."""

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
"""Names in the model that the plant requires of a robot."""

_ATTACHED = "lifeline~"
"""Prefix that is added to the names of attached elements and removed again."""


@dataclass(frozen=True, slots=True)
class Scene:
    """A world, ready to be stepped.

    Attributes:
        model: The compiled model; at its first keyframe, or at its default poses, the robot is at its start.
        movers: People and forklifts; each has a mocap body of the same name.
        size_m: Size of the floor between the walls along x and y, around the origin; None if the walls are unknown.
        standing: The outlines of the static objects at the height of the hull.
        moving_geoms: Solids that move.
        odd_geoms: Static solids without a simple outline.
    """

    model: mj.Model
    movers: tuple[Mover, ...]
    size_m: tuple[float, float] | None
    standing: tuple[Standing, ...]
    moving_geoms: tuple[int, ...]
    odd_geoms: tuple[int, ...]


def build(scene: str | Path = DEFAULT, options: Build | None = None) -> Scene:
    """Build a world.

    Args:
        scene: The name of an included layout, or a layout file (.toml), or an MJCF file. A body named `robot` in an MJCF
            file is the robot; it needs the joints, actuators and sensors of `models/robot_round.xml`. Without such a
            body, the simulated robot is put at the site named `robot_start`.
        options: Options of the robot and the scene.

    Raises:
        SceneError: The scene does not exist or is invalid.
    """
    options = options or Build()
    path = _path(scene)
    ways: list[Mover] = []
    size_m: tuple[float, float] | None = None
    try:
        if path.suffix == ".toml":
            layout = read_layout(path)
            spec = hall.spec_of(layout)
            spec.compiler.fusestatic = True  # fewer bodies: a fifth less computing time
            spec.compiler.discardvisual = not options.scenery
            ways = [mover.mover() for mover in layout.movers]
            size_m = (layout.hall.size_m[0], layout.hall.size_m[1])
        else:
            spec = mj.load_spec(path)
        movers = tuple(ways) if options.moving else ()
        _add_robot(spec, options.hull)
        _equip(spec, options)
        hall.attach(spec, hall.MODELS / "pillar.xml", "pillar", (0.0, 0.0, PARKED_Z_M))
        for mover in movers:
            x_m, y_m, yaw_rad, _ = mover.placed(0.0)
            hall.attach(spec, hall.MODELS / f"{mover.kind}.xml", mover.name, (x_m, y_m, 0.0), yaw_rad)
        return _checked(mj.compile_spec(spec), movers, ways, size_m)
    except ValueError as error:  # from the layout, from MuJoCo, or from an overlap
        raise SceneError(f"the scene {scene} is refused: {mj.one_line(error)}") from error


def pose_of(qpos: list[float]) -> tuple[float, float, float]:
    """Return x [m], y [m] and yaw [rad] in (-π, π] from the seven coordinates of a free joint."""
    x_m, y_m, _, qw, qx, qy, qz = qpos
    return x_m, y_m, math.atan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))


def robot_outline(model: mj.Model, data: mj.Data) -> Outline:
    """Return the hull's outline at the robot's pose; the origin of the robot's frame is its centre."""
    hull = mj.id_of(model, "geom", "hull")
    half_x_m, half_y_m, _ = model.geom_size[hull].tolist()
    base = int(model.jnt_qposadr[mj.id_of(model, "joint", "robot")])
    x_m, y_m, yaw_rad = pose_of(data.qpos[base : base + 7].tolist())
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
    """Add the simulated robot at its start, unless the scene has a robot."""
    if spec.body("robot") is not None:
        return
    site = spec.site("robot_start")
    if site is None:
        raise SceneError(
            "it has no body named 'robot', and no site named 'robot_start' where one could be put"
        )
    if site.parent.name != "world":
        raise SceneError("its site 'robot_start' is not in the world itself but in a body")
    _admit(spec)
    _attach(spec, mj.load_spec(hall.MODELS / f"robot_{hull}.xml"), site)


def _equip(spec: mj.Spec, options: Build) -> None:
    """Check the robot, and set its payload and the grip of its wheels."""
    for kind, names in _PARTS.items():
        for name in names:
            if getattr(spec, kind)(name) is None:
                raise SceneError(f"its robot has no {kind} named {name!r}; see models/robot_round.xml")
    hull = spec.geom("hull")
    if hull.type not in (mj.Shape.BOX, mj.Shape.CYLINDER) or any(hull.pos[:2]):
        raise SceneError("its robot's hull is not a cylinder or box in the middle of the robot")
    if options.payload_kg:
        if not math.isfinite(hull.mass):
            raise SceneError("its robot's hull has no mass of its own, so nothing can be put into it")
        hull.mass += options.payload_kg
    for name in _WHEELS:
        spec.geom(name).friction[0] *= 1.0 - options.wheel_slip


def _admit(spec: mj.Spec) -> None:
    """Adapt a world to the robot: physics options, a floor with contact, and solids that collide and that lidars see."""
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
    """Attach a child's whole model at a site, and keep its names."""
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
    """Return the scene after a check that no objects overlap."""
    data = mj.make_data(model)
    mj.reset(model, data)
    mj.forward(model, data)
    solids = [geom for geom in range(model.ngeom) if model.geom_group[geom] == SOLID_GROUP]
    moving = tuple(geom for geom in solids if _moves(model, geom))
    low_m, high_m = _height_m(model, data, mj.id_of(model, "geom", "hull"))
    still = [
        geom
        for geom in solids
        if geom not in moving and _reaches(_height_m(model, data, geom), low_m, high_m)
    ]
    standing, odd = survey(model, data, still)
    if size_m is None:
        # MuJoCo computes its near clipping plane from the extent, and would include the removed pillar far below.
        model.stat.extent = mj.reach_m(model, data)
    else:
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
    """Return the lowest and the highest z of an upright geom; unbounded for other shapes and tilted geoms."""
    if outline_of(model, data, geom) is None:
        return -math.inf, math.inf
    half = {mj.Shape.BOX: 2, mj.Shape.CYLINDER: 1, mj.Shape.SPHERE: 0}[mj.Shape(model.geom_type[geom])]
    z_m, half_m = float(data.geom_xpos[geom, 2]), float(model.geom_size[geom, half])
    return z_m - half_m, z_m + half_m


def _reaches(height_m: tuple[float, float], low_m: float, high_m: float) -> bool:
    return height_m[0] < high_m and height_m[1] > low_m
