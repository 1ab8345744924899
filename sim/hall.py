"""Build a hall from its layout as a MuJoCo spec: floor, walls, racks, goods and paint, without the robot."""

import math
import random
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from sim import mj
from sim.layout import Layout, Line, Pallet, Racks

MODELS = Path(__file__).with_name("models")

WALLS = ("north wall", "east wall", "south wall", "west wall")

BAY_M, RACK_DEPTH_M = 2.7, 0.9
_WALL_HALF_M = 0.05
_COLUMN_HALF_M = 0.12
_BARREL_M, _BARREL_HALF_M = 0.29, 0.44
_PALLET_M = (0.60, 0.40)
_PALLET_HALF_M = 0.07
_PAINT_M = 0.001
_DASH_M, _GAP_M = 0.5, 0.7

_SHELVES_M = (0.357, 1.152, 1.902)
_SHELF_HALF_M = (1.25, 0.33)
_GOODS_HALF_M = (0.15, 0.18, 0.21, 0.25, 0.29)
_GOODS = (
    "carton",
    "carton",
    "carton_light",
    "carton_dark",
    "crate_grey",
    "crate_blue",
    "crate_green",
    "wrap",
)
_LOADS = {
    "carton": ("carton", "carton_light", "carton_dark"),
    "crate": ("crate_blue", "crate_green", "crate_grey"),
    "wrap": ("wrap",),
}


def spec_of(layout: Layout) -> mj.Spec:
    """Return the hall as a MuJoCo spec with a site named `robot_start`; all solids have readable names."""
    builder = _Builder(layout)
    builder.shell()
    for racks in layout.racks:
        builder.racks(racks)
    for number, pallet in enumerate(layout.pallets, 1):
        builder.pallet(f"pallet {number}", pallet)
    builder.things()
    for line in layout.lines:
        builder.line(line)
    return builder.spec


def attach(spec: mj.Spec, path: Path, name: str, place_m: Sequence[float], yaw_rad: float = 0.0) -> None:
    """Add the only body of a model file under `name`; its first solid gets the same name."""
    child = mj.load_spec(path)
    frame = spec.worldbody.add_frame(pos=place_m, quat=_quat(yaw_rad))
    body = frame.attach_body(child.body(path.stem), f"{name}/", "")
    body.name = name
    for geom in body.geoms:
        geom.name = ""
    next(geom for geom in body.geoms if geom.conaffinity).name = name


class _Builder:
    def __init__(self, layout: Layout) -> None:
        self.spec = mj.load_spec(MODELS / "hall.xml")
        self._layout = layout
        self._random = random.Random(layout.goods_seed)  # noqa: S311 - it fills shelves
        self._world = self.spec.worldbody
        self._solid, self._goods = self.spec.find_default("solid"), self.spec.find_default("goods")

    def shell(self) -> None:
        """Add the floor, the walls with a painted band, the doors and the robot's start."""
        layout, spec = self._layout, self.spec
        (size_x_m, size_y_m), height_m = layout.hall.size_m, layout.hall.wall_m
        x_m, y_m = 0.5 * size_x_m, 0.5 * size_y_m
        spec.modelname = "hall"
        spec.stat.center, spec.stat.extent = (0.0, 0.0, 0.5), 0.52 * math.hypot(size_x_m, size_y_m)
        spec.material("concrete").texrepeat = (size_x_m / 3.0, size_y_m / 3.0)
        self._world.add_geom(
            name="floor",
            type=mj.Shape.PLANE,
            size=(x_m, y_m, 1.0),
            contype=0,
            conaffinity=1,
            condim=3,
            friction=(1.0, 0.005, 0.0001),
            material="concrete",
        )
        start = layout.start
        self._world.add_site(
            name="robot_start", pos=(start.x_m, start.y_m, 0.0), quat=_quat(math.radians(start.yaw_deg))
        )
        half_m, thin_m = 0.5 * height_m, 0.002
        for name, (u, v) in zip(WALLS, ((0, 1), (1, 0), (0, -1), (-1, 0)), strict=True):
            along_x = v != 0
            size_m = (
                (x_m, _WALL_HALF_M, half_m) if along_x else (_WALL_HALF_M, y_m + 2 * _WALL_HALF_M, half_m)
            )
            place_m = (u * (x_m + _WALL_HALF_M), v * (y_m + _WALL_HALF_M), half_m)
            self._add_solid(name, size_m, place_m, "wall")
            band_m = (x_m, thin_m, 0.10) if along_x else (thin_m, y_m, 0.10)
            self._add_goods(band_m, (u * (x_m - thin_m), v * (y_m - thin_m), 1.25), "wall_band")
        for door in layout.doors:
            u, v = {"north": (0, 1), "east": (1, 0), "south": (0, -1), "west": (-1, 0)}[door.wall]
            half_width_m, half_height_m = 0.5 * door.width_m, 0.5 * door.height_m
            self._on_wall(u, v, door.at_m, half_width_m, half_height_m, half_height_m, "door", 0.005)
            for seam in range(1, int(door.height_m / 0.25)):
                self._on_wall(u, v, door.at_m, half_width_m, 0.006, 0.25 * seam, "door_seam", 0.007)
            self._on_wall(u, v, door.at_m, half_width_m, 0.05, 0.05, "black", 0.007)

    def racks(self, racks: Racks) -> None:
        yaw_rad = math.radians(racks.yaw_deg)
        cos_yaw, sin_yaw = math.cos(yaw_rad), math.sin(yaw_rad)
        for bay in range(racks.bays):
            along_m = (bay - 0.5 * (racks.bays - 1)) * BAY_M
            place_m = (racks.x_m + along_m * cos_yaw, racks.y_m + along_m * sin_yaw, 0.0)
            attach(self.spec, MODELS / "rack.xml", f"rack {racks.name} {bay + 1}", place_m, yaw_rad)
            goods = self._world.add_body(pos=place_m, quat=_quat(yaw_rad))
            for shelf_m in _SHELVES_M:
                self._fill(goods, shelf_m, racks.filled)

    def pallet(self, name: str, pallet: Pallet) -> None:
        yaw_rad = math.radians(pallet.yaw_deg)
        body = self._world.add_body(name=name, pos=(pallet.x_m, pallet.y_m, 0.0), quat=_quat(yaw_rad))
        half_x_m, half_y_m = _PALLET_M
        if pallet.load == "stack":
            half_m = 0.5 * pallet.load_m
            self._add_solid(name, (half_x_m, half_y_m, half_m), (0, 0, half_m), "wood", body)
            for layer in range(1, round(pallet.load_m / (2 * _PALLET_HALF_M))):
                size_m = (half_x_m + 0.005, half_y_m + 0.005, 0.008)
                self._add_goods(size_m, (0, 0, layer * 2 * _PALLET_HALF_M), "carton_dark", body)
            return
        self._add_goods(
            (half_x_m - 0.01, half_y_m - 0.01, _PALLET_HALF_M), (0, 0, _PALLET_HALF_M), "wood", body
        )
        material, half_m = self._random.choice(_LOADS[pallet.load]), 0.5 * pallet.load_m
        bottom_m = 2 * _PALLET_HALF_M
        self._add_solid(name, (half_x_m, half_y_m, half_m), (0, 0, bottom_m + half_m), material, body)
        if pallet.load == "carton":
            self._add_layers(body, bottom_m, pallet.load_m)
        top_m = bottom_m + pallet.load_m
        top = self._random.choice(("carton", "carton_light", "carton_dark"))
        high_m = self._half(0.10, 0.20)
        self._add_goods((0.28, half_y_m - 0.03, high_m), (-0.26, 0, top_m + high_m), top, body)

    def things(self) -> None:
        """Add barrels, columns, docks and lamps."""
        layout = self._layout
        for number, barrel in enumerate(layout.barrels, 1):
            self._world.add_geom(
                self._solid,
                name=f"barrel {number}",
                type=mj.Shape.CYLINDER,
                size=(_BARREL_M, _BARREL_HALF_M, 0.0),
                pos=(barrel.x_m, barrel.y_m, _BARREL_HALF_M),
                material=f"barrel_{barrel.colour}",
            )
        half_wall_m = 0.5 * layout.hall.wall_m
        for number, column in enumerate(layout.columns, 1):
            place_m = (column.x_m, column.y_m, half_wall_m)
            size_m = (_COLUMN_HALF_M, _COLUMN_HALF_M, half_wall_m)
            self._add_solid(f"column {number}", size_m, place_m, "column", yaw_deg=column.yaw_deg)
        for number, dock in enumerate(layout.docks, 1):
            place_m, yaw_rad = (dock.x_m, dock.y_m, 0.0), math.radians(dock.yaw_deg)
            attach(self.spec, MODELS / "dock.xml", f"dock {number}", place_m, yaw_rad)
        for lamp in layout.lamps:
            place_m = (lamp.x_m, lamp.y_m, layout.hall.wall_m)
            self._add_goods((0.75, 0.09, 0.03), place_m, "tube", yaw_deg=lamp.yaw_deg, castshadow=False)

    def line(self, line: Line) -> None:
        (x_m, y_m), (to_x_m, to_y_m) = line.from_m, line.to_m
        length_m, yaw_deg = (
            math.dist(line.from_m, line.to_m),
            math.degrees(math.atan2(to_y_m - y_m, to_x_m - x_m)),
        )
        pieces = 1 if not line.dashed else max(1, round((length_m + _GAP_M) / (_DASH_M + _GAP_M)))
        half_m = 0.5 * (_DASH_M if line.dashed else length_m)
        for piece in range(pieces):
            share = (
                0.5 if pieces == 1 else (half_m + piece * (length_m - 2 * half_m) / (pieces - 1)) / length_m
            )
            place_m = (x_m + share * (to_x_m - x_m), y_m + share * (to_y_m - y_m), _PAINT_M)
            self._add_goods((half_m, 0.5 * line.width_m, _PAINT_M), place_m, line.colour, yaw_deg=yaw_deg)

    def _fill(self, body: object, shelf_m: float, filled: float) -> None:
        """Add boxes side by side on one shelf, some with another box on top."""
        pick, half_depth_m = self._random, _SHELF_HALF_M[1]
        x_m = -_SHELF_HALF_M[0]
        while True:
            half_x_m = pick.choice(_GOODS_HALF_M)
            if x_m + 2 * half_x_m > _SHELF_HALF_M[0]:
                return
            size_m = (half_x_m, self._half(0.27, half_depth_m + 0.03), self._half(0.10, 0.29))
            place_m = (x_m + half_x_m, self._half(-0.03, 0.03), shelf_m + size_m[2])
            turned_deg = self._half(-3.0, 3.0)
            taken = pick.random() < filled
            stacked = pick.random() < 0.2
            if taken:
                self._add_goods(size_m, place_m, pick.choice(_GOODS), body, turned_deg)
            if taken and stacked and size_m[2] < 0.18:
                upper_m = (half_x_m - 0.02, size_m[1] - 0.04, self._half(0.08, 0.12))
                above_m = (place_m[0], place_m[1], place_m[2] + size_m[2] + upper_m[2])
                self._add_goods(upper_m, above_m, pick.choice(_GOODS), body, self._half(-5.0, 5.0))
            x_m += 2 * half_x_m + self._half(0.02, 0.12)

    def _add_layers(self, body: object, bottom_m: float, load_m: float) -> None:
        """Add the seams between layers of cartons."""
        half_x_m, half_y_m = _PALLET_M
        layers = max(2, round(load_m / 0.3))
        for layer in range(1, layers):
            size_m = (half_x_m + 0.002, half_y_m + 0.002, 0.004)
            self._add_goods(size_m, (0, 0, bottom_m + layer * load_m / layers), "carton_dark", body)
        for seam_m in (-0.2, 0.2):
            size_m = (0.004, half_y_m + 0.002, 0.5 * load_m - 0.001)
            self._add_goods(size_m, (seam_m, 0, bottom_m + 0.5 * load_m), "carton_dark", body)

    def _half(self, least: float, most: float) -> float:
        return least + (most - least) * self._random.random()

    def _on_wall(
        self,
        u: int,
        v: int,
        at_m: float,
        half_width_m: float,
        half_height_m: float,
        z_m: float,
        material: str,
        thin_m: float,
    ) -> None:
        """Add a panel to the wall in the direction (u, v)."""
        x_m, y_m = (0.5 * size for size in self._layout.hall.size_m)
        size_m = (thin_m, half_width_m, half_height_m) if u else (half_width_m, thin_m, half_height_m)
        place_m = (u * x_m, at_m, z_m) if u else (at_m, v * y_m, z_m)
        self._add_goods(size_m, place_m, material)

    def _add_solid(self, name: str, *box: Any, **values: Any) -> None:  # noqa: ANN401 - those of _add_goods
        self._add_goods(*box, kind=self._solid, name=name, **values)

    def _add_goods(
        self,
        size_m: Sequence[float],
        place_m: Sequence[float],
        material: str,
        body: mj.Spec = None,
        yaw_deg: float = 0.0,
        kind: mj.Spec = None,
        **values: object,
    ) -> None:
        """Add a box to a body, or else to the world."""
        parent, quat = body or self._world, _quat(math.radians(yaw_deg))
        kind = kind or self._goods
        parent.add_geom(
            kind, type=mj.Shape.BOX, size=size_m, pos=place_m, material=material, quat=quat, **values
        )


def _quat(yaw_rad: float) -> tuple[float, float, float, float]:
    return (math.cos(0.5 * yaw_rad), 0.0, 0.0, math.sin(0.5 * yaw_rad))
