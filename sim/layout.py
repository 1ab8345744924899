"""Layout of a hall: a strictly checked TOML file. This module creates no geometry; `scene` builds the hall.

Lengths are in m, yaw in degrees, counter-clockwise from x. The origin is the centre of the hall. The walls stand outside
its size.
"""

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError, model_validator

from sim.movers import BODIES, Mover, MoverKind, Way
from wire.foreign import ForeignError, from_toml, read_text
from wire.host.config import Section

LAYOUTS = Path(__file__).with_name("layouts")

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Place = Annotated[list[Finite], Field(min_length=2, max_length=2)]
"""x and y [m]."""


Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9 _-]*$", max_length=32)]


_A_LIST = Field(strict=False)
"""TOML has no tuples."""


class LayoutError(ValueError):
    """The layout is refused; the message says why, and what to do."""


class Hall(Section):
    """Size of the floor between the walls, along x and y."""

    size_m: Annotated[list[Annotated[float, Field(ge=2, le=200)]], Field(min_length=2, max_length=2)]
    wall_m: Positive = 3.0


class Start(Section):
    """The robot's pose at the start and after a reset."""

    x_m: Finite = 0.0
    y_m: Finite = 0.0
    yaw_deg: Finite = 0.0


class Thing(Section):
    """An object at a place."""

    x_m: Finite
    y_m: Finite
    yaw_deg: Finite = 0.0


class Racks(Thing):
    """A row of rack bays of 2.7 m × 0.9 m; the place is the centre of the row."""

    name: Name
    bays: Annotated[int, Field(ge=1, le=20)] = 1
    filled: Annotated[float, Field(ge=0, le=1)] = 0.9
    """Share of the shelves with goods."""


class Pallet(Thing):
    """A pallet of 1.2 m × 0.8 m."""

    load: Literal["carton", "crate", "wrap", "stack"] = "carton"
    load_m: Annotated[float, Field(ge=0.3, le=2.0)] = 0.8


class Barrel(Section):
    """A barrel with a diameter of 0.58 m."""

    x_m: Finite
    y_m: Finite
    colour: Literal["blue", "yellow"] = "blue"


class Door(Section):
    """A roller door, painted on a wall."""

    wall: Literal["north", "east", "south", "west"]
    at_m: Finite
    width_m: Positive = 1.6
    height_m: Positive = 2.3


class Line(Section):
    """A line painted on the floor."""

    from_m: Place
    to_m: Place
    width_m: Positive = 0.08
    colour: Literal["yellow", "white", "green"] = "yellow"
    dashed: bool = False


class MoverSection(Section):
    """A person or forklift that moves along waypoints."""

    name: Name
    kind: Literal["person", "forklift"]
    waypoints_m: Annotated[list[Place], Field(min_length=2)]
    speed_m_s: Positive
    dwell_s: Annotated[float, Field(ge=0, allow_inf_nan=False)] = 0.0
    loop: bool = False
    yields: bool = True
    yields_m: Positive | None = None

    @model_validator(mode="after")
    def _makes_sense(self) -> "MoverSection":
        self.mover()
        return self

    def mover(self) -> Mover:
        kind = MoverKind(self.kind)
        way = Way(
            tuple((x, y) for x, y in self.waypoints_m),
            self.speed_m_s,
            self.dwell_s,
            loop=self.loop,
            backs_up=kind is MoverKind.FORKLIFT,
        )
        yields_m = BODIES[kind].yields_m if self.yields_m is None else self.yields_m
        return Mover(self.name, kind, way, yields_m if self.yields else None)


class Layout(Section):
    """One hall and its contents."""

    hall: Hall
    start: Start = Start()
    goods_seed: Annotated[int, Field(ge=0)] = 0
    racks: Annotated[tuple[Racks, ...], _A_LIST] = ()
    pallets: Annotated[tuple[Pallet, ...], _A_LIST] = ()
    barrels: Annotated[tuple[Barrel, ...], _A_LIST] = ()
    columns: Annotated[tuple[Thing, ...], _A_LIST] = ()
    docks: Annotated[tuple[Thing, ...], _A_LIST] = ()
    doors: Annotated[tuple[Door, ...], _A_LIST] = ()
    lines: Annotated[tuple[Line, ...], _A_LIST] = ()
    lamps: Annotated[tuple[Thing, ...], _A_LIST] = ()
    movers: Annotated[tuple[MoverSection, ...], _A_LIST] = ()

    @model_validator(mode="after")
    def _names_are_unique(self) -> "Layout":
        names = [thing.name for thing in (*self.racks, *self.movers)]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"two things are named {name!r}")
        return self


def known() -> list[str]:
    """Return the names of the included layouts."""
    return sorted(path.stem for path in LAYOUTS.glob("*.toml"))


def read_layout(path: Path) -> Layout:
    """Read a layout file.

    Raises:
        LayoutError: The file cannot be read, is not TOML, or has invalid keys or values; the message names all of them.
    """
    try:
        document = from_toml(read_text(path))
    except OSError as error:
        raise LayoutError(f"it cannot be read: {error.strerror}") from error
    except ForeignError as error:
        raise LayoutError(f"it is not TOML: {error}") from error
    try:
        return Layout.model_validate(document)
    except ValidationError as error:
        faults = "; ".join(_sentence(dict(fault)) for fault in error.errors(include_url=False))
        raise LayoutError(faults) from error


def _sentence(fault: dict[str, Any]) -> str:
    path = ".".join(map(str, fault["loc"])) or "it"
    if fault["type"] == "extra_forbidden":
        return f"{path}: there is no such key"
    if fault["type"] == "missing":
        return f"{path} is missing"
    message = str(fault["msg"]).removeprefix("Value error, ")
    if fault["type"] == "value_error":
        return f"{path}: {message}"
    return f"{path} = {fault['input']!r:.200}: {message[0].lower()}{message[1:]}"
