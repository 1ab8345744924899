"""Logs primitives to Rerun, and the layout of its viewer. The only file that imports `rerun`."""

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any, assert_never

import numpy as np
import pyarrow as pa
import rerun as rr
import rerun.blueprint as rrb

from lifeline.view import scene
from lifeline.view.shapes import (
    Area,
    Floats,
    Frame,
    Line,
    LogLine,
    Points,
    Primitive,
    State,
    Value,
)

APPLICATION = "lifeline"
TIMELINE = "time"
KEPT = "1GiB"
"""Size of the buffer that is sent to a viewer when it connects; beyond it, the oldest data are dropped."""
SHOWN_S = 30.0
"""Seconds that the plots show while the view follows the robot."""

NO_STATE: Any = pa.array([None], pa.utf8())  # pyright: ignore[reportUnknownVariableType] - no stubs
SERIES = {
    scene.REQUESTED: (scene.WARNING_RING, 3.5),
    scene.PERMITTED: (scene.MODE_COLOURS["DRIVING"], 2.5),
    scene.MEASURED: ((235, 238, 242, 255), 1.2),
}
"""Colour and width of each velocity's line."""


class RerunLog:
    """One recording of Rerun, which goes to a file or to the viewers that connect.

    Args:
        name: the name that the viewer shows.
        follows: whether data arrive as they happen, so that the plots show the last seconds.
    """

    def __init__(self, name: str, *, follows: bool) -> None:
        self._name = name
        self._blueprint = layout(follows=follows)
        self._stream = rr.RecordingStream(APPLICATION)

    def save(self, path: Path) -> None:
        """Write to a file, which is overwritten.

        Raises:
            OSError, RuntimeError: the file cannot be created.
        """
        self._stream.save(path, default_blueprint=self._blueprint)
        self._begin()

    def serve(self, port: int) -> str:
        """Serve to viewers on this machine alone; return the address for them."""
        sink = rr.GrpcServerSink(bind_ip="127.0.0.1", port=port, server_memory_limit=KEPT)
        self._stream.set_sinks(sink, default_blueprint=self._blueprint)
        self._begin()
        return sink.uri

    def fixed(self, primitives: Iterable[Primitive]) -> None:
        """Log primitives that are valid at all times."""
        for one in primitives:
            path, archetype = _archetype(one)
            self._stream.log(path, archetype, static=True)

    def log(self, time_ns: int, primitives: Iterable[Primitive]) -> None:
        """Log primitives with a time [ns] of the wall clock."""
        self._stream.set_time(TIMELINE, timestamp=np.datetime64(time_ns, "ns"))
        for one in primitives:
            self._stream.log(*_archetype(one))

    def close(self) -> None:
        """Send or write everything that was logged."""
        self._stream.flush()
        self._stream.disconnect()

    def _begin(self) -> None:
        self._stream.send_recording_name(self._name)
        self._stream.log(scene.ODOM, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        for parent, unit in ((scene.LINEAR, "m/s"), (scene.ANGULAR, "rad/s")):
            for name, (colour, width) in SERIES.items():
                line = rr.SeriesLines(colors=[colour], widths=[width], names=[f"{name} [{unit}]"])
                self._stream.log(f"{parent}/{name}", line, static=True)
        for name, colour, width in (
            ("nearest", scene.TRAIL, 2.5),
            ("warning", scene.WARNING_RING, 1.2),
            ("stop", scene.STOP_RING, 1.2),
        ):
            line = rr.SeriesLines(colors=[colour], widths=[width], names=[f"{name} [m]"])
            self._stream.log(f"{scene.DISTANCE}/{name}", line, static=True)
        modes = rr.StateConfiguration(
            values=list(scene.MODE_COLOURS), colors=list(scene.MODE_COLOURS.values())
        )
        self._stream.log(scene.MODE, modes, static=True)


def _archetype(one: Primitive) -> tuple[str, rr.AsComponents]:
    """Return the path and the archetype of a primitive."""
    match one:
        case Frame(name, x_m, y_m, yaw_rad):
            turn = rr.Quaternion(xyzw=[0.0, 0.0, math.sin(yaw_rad / 2), math.cos(yaw_rad / 2)])
            return _path(name), rr.Transform3D(translation=[x_m, y_m, 0.0], quaternion=turn)
        case Points(path, points_m, colours):
            return _path(path), rr.Points3D(_raised(points_m, 0.05), colors=colours, radii=0.022)
        case Line(path, points_m, colour, radius_m, height_m):
            line = _raised(points_m, height_m)
            return _path(path), rr.LineStrips3D([line], colors=[colour], radii=radius_m)
        case Area(path, corners_m, triangles, colour, height_m):
            return _path(path), rr.Mesh3D(
                vertex_positions=_raised(corners_m, height_m),
                triangle_indices=triangles,
                albedo_factor=colour,
            )
        case Value(path, value):
            return path, rr.Scalars(value)
        case State(path, text):
            return path, rr.StateChange(state=text) if text else rr.StateChange(state=NO_STATE)
        case LogLine(path, text, level):
            return path, rr.TextLog(text, level=level.value)
        case _:
            assert_never(one)


def _path(name: str) -> str:
    """Return the entity of a path whose first part is a frame: all frames are below `odom`."""
    return name if name.partition("/")[0] == scene.ODOM else f"{scene.ODOM}/{name}"


def _raised(points_m: Floats, height_m: float) -> Floats:
    """Return points (n, 2) [m] as (n, 3) at a height."""
    return np.column_stack((points_m, np.full(len(points_m), height_m)))


def layout(*, follows: bool) -> rrb.Blueprint:
    """Return the layout of the viewer: the robot beside its mode, velocities, distance and log."""
    recent = (
        [
            rrb.VisibleTimeRange(
                TIMELINE,
                start=rrb.TimeRangeBoundary.cursor_relative(seconds=-SHOWN_S),
                end=rrb.TimeRangeBoundary.cursor_relative(),
            )
        ]
        if follows
        else None
    )

    def plot(origin: str, name: str, least: float, most: float, legend: rrb.Corner2D) -> rrb.TimeSeriesView:
        return rrb.TimeSeriesView(
            origin=origin,
            name=name,
            axis_y=rrb.ScalarAxis(range=(least, most)),
            plot_legend=rrb.PlotLegend(legend),
            time_ranges=recent,
        )

    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(
                rrb.Spatial3DView(
                    origin=scene.ODOM,
                    name="Robot",
                    background=(13, 17, 23),
                    line_grid=rrb.LineGrid3D(spacing=1.0, color=(120, 130, 145, 60)),
                    eye_controls=rrb.EyeControls3D(
                        position=(-2.8, 0.0, 4.4),
                        look_target=(0.0, 0.0, 0.0),
                        eye_up=(0.0, 0.0, 1.0),
                        # Only an entity with a shape can be followed.
                        tracking_entity=f"{scene.ODOM}/{scene.BASE}/outline",
                    ),
                ),
                rrb.TextLogView(
                    origin=scene.LOG,
                    name="Log",
                    columns=rrb.TextLogColumns(text_log_columns=["LogLevel", "Body"]),
                ),
                row_shares=(3, 1),
            ),
            rrb.Vertical(
                rrb.StateTimelineView(
                    origin="/",
                    contents=[scene.MODE, scene.CAUSES, scene.LATCHED, f"{scene.SCANS}/**"],
                    name="Mode, reasons, scans",
                    time_ranges=recent,
                ),
                plot(scene.LINEAR, "Forward velocity", -1.1, 1.1, rrb.Corner2D.LeftBottom),
                plot(scene.ANGULAR, "Turn rate", -2.2, 2.2, rrb.Corner2D.LeftBottom),
                plot(
                    scene.DISTANCE,
                    "Distance of the nearest point from the hull",
                    0.0,
                    2.0,
                    rrb.Corner2D.LeftTop,
                ),
                row_shares=(2, 2, 2, 2),
            ),
            column_shares=(5, 4),
        ),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="following" if follows else "playing"),
        rrb.SelectionPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
        auto_views=False,
        auto_layout=False,
    )
