"""Whether a scene can be: nothing in a wall or in another thing, a free start, and free ways for what moves. Pure."""

from collections.abc import Collection, Sequence

from sim.floorplan import Circle, FloorPlan, Outline, Standing
from sim.movers import Mover

OVERLAP_M = 0.002
"""Things that stand side by side may overlap by this much: the numbers in files are rounded."""


class RoomError(ValueError):
    """Something has no room; the message says what, and where."""


def check_things(standing: Sequence[Standing], walls: Collection[str], size_m: tuple[float, float]) -> None:
    """Refuses what stands in a wall, or in another thing.

    Args:
        standing: Everything that stands on the floor, the walls too.
        walls: Their names.
        size_m: The floor between them along x and y, around the origin.

    Raises:
        RoomError: Naming the first that has no room.
    """
    things = [thing for thing in standing if thing.name not in walls]
    for thing in things:
        if not is_inside(thing.outline, size_m, OVERLAP_M):
            raise RoomError(f"{_at(thing)} reaches into or beyond the walls.")
    plan = FloorPlan(things)
    for thing in things:
        others = [other for other in plan.overlapping(thing.outline, OVERLAP_M) if other != thing.name]
        if others:
            raise RoomError(f"{_at(thing)} stands in {others[0]}.")


def check_start(plan: FloorPlan, hull: Outline) -> None:
    """Refuses a robot that would start in something.

    Raises:
        RoomError: Naming what it is.
    """
    nearest = plan.nearest(hull)
    if nearest.distance_m <= 0.0:
        raise RoomError(f"the robot's start, ({hull.x_m:g}, {hull.y_m:g}) m, is in {nearest.name}.")


def check_way(mover: Mover, plan: FloorPlan, hull: Outline) -> None:
    """Refuses a way that leads through what stands, or that begins where the robot does.

    Raises:
        RoomError: Naming what it leads through.
    """
    for taken in mover.swept():
        nearest = plan.nearest(taken)
        if nearest.distance_m < -OVERLAP_M:
            raise RoomError(f"the way of {mover.name} leads through {nearest.name}.")
    first = FloorPlan([Standing("robot", hull)]).nearest(mover.footprint(mover.placed(0.0)))
    if first.distance_m <= 0.0:
        raise RoomError(f"the way of {mover.name} begins where the robot starts.")


def is_inside(outline: Outline, size_m: tuple[float, float], slack_m: float = 0.0) -> bool:
    """Whether all of an outline is on the floor between the walls, but for the slack."""
    half_x_m, half_y_m = 0.5 * size_m[0] + slack_m, 0.5 * size_m[1] + slack_m
    if isinstance(outline, Circle):
        return max(abs(outline.x_m) - half_x_m, abs(outline.y_m) - half_y_m) <= -outline.radius_m
    return all(abs(x_m) <= half_x_m and abs(y_m) <= half_y_m for x_m, y_m in outline.corners_m())


def _at(thing: Standing) -> str:
    return f"{thing.name} at ({thing.outline.x_m:g}, {thing.outline.y_m:g}) m"
