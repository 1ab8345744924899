"""The robot in the picture: the values of the supervisor's section that a display needs. Pure."""

from typing import Any, cast

from teleop.screen.view import Robot
from wire import topics

_DEFAULT = Robot()


def robot_of(document: dict[str, Any]) -> Robot:
    """Return the hull, the lidar's mount, and the stop and warning distances in a robot.toml, for the picture.

    They are used only for drawing: missing or invalid values are replaced by defaults. The supervisor checks the
    configuration itself and refuses to start with invalid values.
    """
    supervisor = _table(document, "supervisor")
    hull, lidar = _table(supervisor, "footprint"), _lidar_on_scan(supervisor)
    return Robot(
        radius_m=_number(hull, "radius_m", _DEFAULT.radius_m),
        corners_m=_corners(hull),
        lidar_x_m=_number(lidar, "x_m", 0.0),
        lidar_y_m=_number(lidar, "y_m", 0.0),
        lidar_yaw_rad=_number(lidar, "yaw_rad", 0.0),
        stop_distance_m=_number(supervisor, "stop_distance_m", _DEFAULT.stop_distance_m),
        warning_distance_m=_number(supervisor, "warning_distance_m", _DEFAULT.warning_distance_m),
    )


def _table(document: dict[str, Any], name: str) -> dict[str, Any]:
    value = document.get(name)
    return cast("dict[str, Any]", value) if isinstance(value, dict) else {}


def _lidar_on_scan(supervisor: dict[str, Any]) -> dict[str, Any]:
    """Return the section of the lidar whose scan is drawn: the only one, or the one on the topic `scan`."""
    lidars = supervisor.get("lidars")
    if not isinstance(lidars, list):
        return _table(supervisor, "lidar")
    for entry in cast("list[object]", lidars):
        if isinstance(entry, dict):
            table = cast("dict[str, Any]", entry)
            if table.get("topic") == topics.SCAN.key:
                return table
    return {}


def _number(table: dict[str, Any], name: str, default: float) -> float:
    value = table.get(name)
    return float(value) if isinstance(value, int | float) else default


def _corners(hull: dict[str, Any]) -> tuple[tuple[float, float], ...]:
    try:
        return tuple((float(x_m), float(y_m)) for x_m, y_m in hull.get("corners_m", ()))
    except (TypeError, ValueError):
        return ()
