"""Check a scene: no object overlaps a wall or another object, and the start and the movers' paths are free. Pure."""

from collections.abc import Collection, Sequence

from sim.floorplan import Circle, FloorPlan, Outline, Standing
from sim.movers import Mover

OVERLAP_M = 0.002
"""Tolerance for overlaps of neighbouring objects, because the numbers in files are rounded."""


class RoomError(ValueError):
    """An object overlaps another; the message names the object and its place."""


def check_things(standing: Sequence[Standing], walls: Collection[str], size_m: tuple[float, float]) -> None:
    """Check that no object overlaps a wall or another object.

    Args:
        standing: All objects on the floor, including the walls.
        walls: The names of the walls.
        size_m: Size of the floor between the walls along x and y, around the origin.

    Raises:
        RoomError: An object overlaps; the message names the first one.
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
    """Check that the robot's start is free.

    Raises:
        RoomError: The start is occupied; the message names the object.
    """
    nearest = plan.nearest(hull)
    if nearest.distance_m <= 0.0:
        raise RoomError(f"the robot's start, ({hull.x_m:g}, {hull.y_m:g}) m, is in {nearest.name}.")


def check_way(mover: Mover, plan: FloorPlan, hull: Outline) -> None:
    """Check that a mover's path does not lead through static objects or begin at the robot's start.

    Raises:
        RoomError: The path is not free; the message names the object.
    """
    for taken in mover.swept():
        nearest = plan.nearest(taken)
        if nearest.distance_m < -OVERLAP_M:
            raise RoomError(f"the path of {mover.name} passes through {nearest.name}.")
    first = FloorPlan([Standing("robot", hull)]).nearest(mover.footprint(mover.placed(0.0)))
    if first.distance_m <= 0.0:
        raise RoomError(f"the path of {mover.name} begins where the robot starts.")


def is_inside(outline: Outline, size_m: tuple[float, float], slack_m: float = 0.0) -> bool:
    """Return whether an outline is completely on the floor between the walls, with a tolerance of `slack_m`."""
    half_x_m, half_y_m = 0.5 * size_m[0] + slack_m, 0.5 * size_m[1] + slack_m
    if isinstance(outline, Circle):
        return max(abs(outline.x_m) - half_x_m, abs(outline.y_m) - half_y_m) <= -outline.radius_m
    return all(abs(x_m) <= half_x_m and abs(y_m) <= half_y_m for x_m, y_m in outline.corners_m())


def _at(thing: Standing) -> str:
    return f"{thing.name} at ({thing.outline.x_m:g}, {thing.outline.y_m:g}) m"
