"""Every number of robot.toml has a lower and an upper bound, found in the models themselves."""

import math
import types
from collections.abc import Iterator
from typing import Annotated, Any, NamedTuple, Union, get_args, get_origin

import pytest
from pydantic import BaseModel

from sim.config import SimSection
from supervisor.config import SupervisorSection
from teleop.pilots.config import TeleopSection
from wire.host.config import Between, BusSection, ConfigError, Section, section

MODELS: dict[str, type[Section]] = {
    "bus": BusSection,
    "supervisor": SupervisorSection,
    "teleop": TeleopSection,
    "sim": SimSection,
}


class Number(NamedTuple):
    """A place for a number in robot.toml."""

    path: tuple[str | int, ...]
    """Section first; an index stands for any entry of a list."""
    kind: type[int] | type[float]
    bounds: Between | None

    @property
    def name(self) -> str:
        return ".".join(map(str, self.path))


def numbers(
    path: tuple[str | int, ...], annotation: object, metadata: tuple[Any, ...] = ()
) -> Iterator[Number]:
    """Return every number in an annotation."""
    if get_origin(annotation) is Annotated:
        inner, *more = get_args(annotation)
        yield from numbers(path, inner, (*more, *metadata))
    elif get_origin(annotation) in {Union, types.UnionType}:
        for choice in get_args(annotation):
            yield from numbers(path, choice, metadata)
    elif get_origin(annotation) in {list, tuple}:
        entries = [entry for entry in get_args(annotation) if entry is not Ellipsis]
        for index, entry in enumerate(entries):
            yield from numbers((*path, index), entry)
    elif isinstance(annotation, type) and issubclass(annotation, BaseModel):
        for key, field in annotation.model_fields.items():
            yield from numbers((*path, key), field.annotation, tuple(field.metadata))
    elif annotation in {int, float}:
        bounds = [entry for entry in metadata if isinstance(entry, Between)]
        yield Number(path, annotation, bounds[0] if bounds else None)


NUMBERS = [number for name, model in MODELS.items() for number in numbers((name,), model)]


def refusal(number: Number, value: float) -> str:
    """Return the error for this number in a document with nothing else; empty if it is valid."""
    *places, last = number.path[1:]
    document = _around(last, value)
    for place in reversed(places):
        document = _around(place, document)
    name = str(number.path[0])
    try:
        section({name: document}, name, MODELS[name])
    except ConfigError as error:
        lines = [line.strip() for line in str(error).splitlines()]
        return next(
            (line for line in lines if line.startswith(f"{number.name} = ") and "must be from" in line), ""
        )
    return ""


def _around(place: str | int, value: object) -> object:
    """A table or a list with this value in this place."""
    if isinstance(place, str):
        return {place: value}
    entries: list[object] = [0.1, 0.1]
    entries[place] = value
    return entries if isinstance(value, float | int | list) else entries[: place + 1]


def test_the_models_have_all_the_kinds_of_places_that_a_number_can_be_in() -> None:
    names = {number.name for number in NUMBERS}
    assert names >= {
        "bus.lease_s",
        "supervisor.sources.0.priority",
        "supervisor.footprint.corners_m.0.1",
        "supervisor.lidar.own.free_codes_m.0",
        "supervisor.lidars.0.view_rad.1",
        "teleop.gamepad.dead_zone",
        "sim.braking_m_s2",
    }
    assert len(NUMBERS) > 90


@pytest.mark.parametrize("number", NUMBERS, ids=lambda number: number.name)
def test_every_number_has_an_upper_and_a_lower_bound(number: Number) -> None:
    assert number.bounds is not None
    assert math.isfinite(number.bounds.low)
    assert math.isfinite(number.bounds.high)
    assert number.bounds.low < number.bounds.high


@pytest.mark.parametrize("number", NUMBERS, ids=lambda number: number.name)
def test_a_number_at_its_bounds_is_in_them_and_just_outside_is_refused_with_what_is_allowed(
    number: Number,
) -> None:
    assert number.bounds is not None
    low, high = number.kind(number.bounds.low), number.kind(number.bounds.high)
    below, above = (
        (low - 1, high + 1)
        if number.kind is int
        else (math.nextafter(low, -math.inf), math.nextafter(high, math.inf))
    )
    assert refusal(number, low) == ""
    assert refusal(number, high) == ""
    for value in (below, above):
        assert f"{number.name} = {value!r}: must be from " in refusal(number, value)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e9, -1e9])
@pytest.mark.parametrize("number", [n for n in NUMBERS if n.kind is float], ids=lambda number: number.name)
def test_no_magic_value_switches_anything_off(number: Number, value: float) -> None:
    assert f"{number.name} = {value!r}: must be from " in refusal(number, value)


@pytest.mark.parametrize("name", MODELS)
def test_the_defaults_are_within_their_bounds_and_fit_together(name: str) -> None:
    values = MODELS[name]().model_dump(mode="json", exclude_none=True)
    assert section({name: values}, name, MODELS[name]) == MODELS[name]()


def test_a_number_without_bounds_is_found() -> None:
    class Careless(Section):
        timeouts_s: tuple[float, ...] = ()

    assert [number.bounds for number in numbers(("careless",), Careless)] == [None]
