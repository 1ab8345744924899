"""Every value of the law's types is restored bit for bit from memory and JSON."""

import json
import marshal
import math
import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum
from functools import cache
from types import NoneType, UnionType
from typing import Any, Literal, NamedTuple, Union, cast, get_args, get_origin, get_type_hints

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from supervisor.blackbox.codec import Codec, codec, record_codec
from supervisor.law.clearance import Circle, ConvexPolygon, Hull
from supervisor.law.decision import Decision, Mode
from supervisor.law.model import Inputs, LawConfig
from supervisor.law.reckoning import Velocity
from supervisor.law.scan import LaserScan
from supervisor.law.state import State
from tests.unit.supervisor.law.law_harness import CONFIG, laser_scan, ring
from wire.reasons import StopReason

HULLS = (Circle(0.25), ConvexPolygon(((0.3, 0.2), (-0.3, 0.2), (-0.3, -0.2), (0.3, -0.2))))
LEAVES: Mapping[Any, st.SearchStrategy[Any]] = {
    float: st.floats(),
    int: st.integers(),
    bool: st.booleans(),
    str: st.text(max_size=8),
    bytes: st.binary(max_size=20),
    NoneType: st.none(),
    Hull: st.sampled_from(HULLS),
}


@cache
def values(hint: Any) -> st.SearchStrategy[Any]:  # noqa: ANN401 - a hint may be any object
    """Any value of a type hint, so that new fields of the model are tested as well."""
    origin: Any = get_origin(hint)
    arguments = get_args(hint)
    if hint in LEAVES:
        return LEAVES[hint]
    if origin in {Union, UnionType}:
        return st.one_of([values(option) for option in arguments])
    if origin is Literal:
        return st.sampled_from(arguments)
    if origin is tuple and arguments[-1] is not ...:
        return st.tuples(*[values(item) for item in arguments])
    if origin in {tuple, frozenset}:
        build = cast("Callable[[list[Any]], Any]", origin)
        return st.lists(values(arguments[0]), max_size=2).map(build)
    if origin is np.ndarray:
        (dtype,) = get_args(arguments[1])
        return hnp.arrays(dtype, hnp.array_shapes(min_dims=1, max_dims=2, min_side=0, max_side=5))
    if issubclass(hint, Enum):
        return st.sampled_from(list(hint))
    hints = get_type_hints(hint)
    return st.builds(hint, **{name: values(hints[name]) for name in field_names(hint)})


def field_names(cls: Any) -> list[str]:  # noqa: ANN401 - a dataclass or a NamedTuple
    return [f.name for f in fields(cls)] if is_dataclass(cls) else list(cls._fields)


def assert_same(left: Any, right: Any) -> None:  # noqa: ANN401 - anything
    """Equal to the bit: −0.0 is not 0.0, and NaN is NaN."""
    assert type(left) is type(right)
    if isinstance(left, float):
        assert struct.pack("d", left) == struct.pack("d", right) or (math.isnan(left) and math.isnan(right))
    elif isinstance(left, np.ndarray):
        assert (left.dtype, left.shape, left.tobytes()) == (right.dtype, right.shape, right.tobytes())
    elif is_dataclass(left) or hasattr(left, "_fields"):
        for name in field_names(type(left)):
            assert_same(getattr(left, name), getattr(right, name))
    elif isinstance(left, tuple):
        assert len(left) == len(right)  # pyright: ignore[reportUnknownArgumentType]
        for i, item in enumerate(left):  # pyright: ignore[reportUnknownVariableType, reportUnknownArgumentType]
            assert_same(item, right[i])
    else:
        assert left == right


def there(c: Codec, value: object) -> Any:  # noqa: ANN401 - any JSON
    """Convert through memory and JSON, like a black box."""
    packed = marshal.loads(marshal.dumps(c.pack(value), 2))
    return json.loads(json.dumps(c.spell(packed), allow_nan=False))


def there_and_back(hint: Any, value: object) -> object:  # noqa: ANN401 - a hint
    return codec(hint).read(there(codec(hint), value))


RECORDED = (Inputs, State, Decision, LawConfig)
LARGE_VALUES = settings(suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])


@pytest.mark.parametrize("cls", RECORDED)
@settings(LARGE_VALUES, max_examples=30)
@given(data=st.data())
def test_a_decoded_value_equals_the_encoded_one(cls: type[Any], data: st.DataObject) -> None:
    value = data.draw(values(cls))
    assert_same(there_and_back(cls, value), value)


@pytest.mark.proof
@pytest.mark.parametrize("cls", RECORDED)
@settings(LARGE_VALUES, max_examples=150)
@given(data=st.data())
def test_every_value_comes_back_exactly(cls: type[Any], data: st.DataObject) -> None:
    value = data.draw(values(cls))
    assert_same(there_and_back(cls, value), value)


@pytest.mark.parametrize(
    "number", [0.0, -0.0, math.inf, -math.inf, math.nan, 5e-324, 0.1, 1 / 3, 1.7976931348623157e308]
)
def test_every_kind_of_float_comes_back_with_its_bits(number: float) -> None:
    assert_same(there_and_back(Velocity, Velocity(number, -number)), Velocity(number, -number))


def test_a_scan_comes_back_with_the_bits_of_each_reading() -> None:
    ranges = ring()
    ranges[:6] = [np.nan, np.inf, -np.inf, -0.0, 1e-45, 0.1]
    scan = laser_scan(ranges, 1000.0)
    assert_same(there_and_back(LaserScan, scan), scan)


def test_a_view_into_an_array_comes_back_as_its_values() -> None:
    points = np.arange(12.0).reshape(6, 2)
    back = there_and_back(np.ndarray[Any, np.dtype[np.float64]], points[::-1, 1])
    assert isinstance(back, np.ndarray)
    assert back.tolist() == [11.0, 9.0, 7.0, 5.0, 3.0, 1.0]


def test_a_number_of_numpy_s_is_written_as_the_number_it_is() -> None:
    """A numpy float64 passes for a float with every type checker."""
    assert_same(there_and_back(Velocity, Velocity(np.float64(1 / 3), 1)), Velocity(1 / 3, 1.0))


def test_a_set_is_written_in_the_same_order_in_every_run() -> None:
    document = there(codec(frozenset[StopReason]), frozenset(StopReason))
    assert document == sorted(reason.name for reason in StopReason)


def test_json_names_fields_enums_and_the_hull_s_class() -> None:
    decision = there(codec(tuple[Mode, Velocity]), (Mode.LIMITED, Velocity(math.inf, 0.0)))
    assert decision == ["LIMITED", {"linear_m_s": "Infinity", "angular_rad_s": 0.0}]
    assert there(codec(LawConfig), CONFIG)["hull"] == {"type": "Circle", "radius_m": 0.25}


def test_a_field_that_an_older_file_lacks_has_its_default() -> None:
    document = there(codec(Inputs), Inputs(estop=True))
    del document["strangers"]
    assert codec(Inputs).read(document) == Inputs(estop=True)


LONG = "x" * 70_000
LONGEST_SENTENCE = 200


@pytest.mark.parametrize(
    ("hint", "document", "sentence"),
    [
        (Velocity, {"linear_m_s": 0.0, "angular_rad_s": 0.0, "up": 1.0}, "Velocity has no up"),
        (Velocity, {"linear_m_s": 0.0}, "Velocity: .*missing.*angular_rad_s"),
        (Velocity, {"linear_m_s": "0.0", "angular_rad_s": 0.0}, "'0.0' is not a number"),
        (Velocity, [0.0, 0.0], r"\[0.0, 0.0\] is not of type dict"),
        (bool, 1, "1 is not of type bool"),
        (int, True, "True is not of type int"),
        (str, b"", "is not of type str"),
        (bytes, "no base64!", "base64"),
        (tuple[int, ...], {}, "is not of type list"),
        (tuple[int, int], [1], "shorter"),
        (Mode, "FLYING", "no Mode FLYING"),
        (float, None, "None is not a number"),
        (Mode, None, "None is not of type str"),
        (Hull, None, "None is not of type dict"),
        (tuple[int, ...], [None], "None is not of type int"),
        (tuple[int, int], [1, None], "None is not of type int"),
        (
            np.ndarray[Any, np.dtype[np.float32]],
            {"dtype": "<f4", "shape": [2**63], "base64": ""},
            "dimension",
        ),
        (
            np.ndarray[Any, np.dtype[np.float32]],
            {"dtype": "<U1", "shape": [1], "base64": "AAAAAA=="},
            "an array of <U1",
        ),
        (Hull, {"type": "Square", "radius_m": 1.0}, "no type Square"),
        (Hull, {"radius_m": 1.0}, "no type None"),
        (np.ndarray[Any, np.dtype[np.float32]], {"dtype": "<f4", "shape": [2]}, "base64"),
        (np.ndarray[Any, np.dtype[np.float32]], {"dtype": "<f4", "shape": [2], "base64": ""}, "reshape"),
        (
            np.ndarray[Any, np.dtype[np.float32]],
            {"dtype": "|O", "shape": [1], "base64": "AAAAAAAAAAA="},
            "an array of object",
        ),
        (Velocity, {LONG: 0.0}, "Velocity has no x{60}$"),
        (Mode, LONG, "no Mode x{60}$"),
        (Hull, {"type": LONG}, "no type x{60}$"),
        (
            np.ndarray[Any, np.dtype[np.float32]],
            {"dtype": ",".join(["<f4"] * 1000), "shape": [1], "base64": ""},
            "an array of ",
        ),
    ],
)
def test_json_that_is_not_of_the_type_is_refused_with_a_sentence(
    hint: Any,  # noqa: ANN401
    document: object,
    sentence: str,
) -> None:
    with pytest.raises(ValueError, match=sentence) as refusal:
        codec(hint).read(document)
    assert len(str(refusal.value)) < LONGEST_SENTENCE


@pytest.mark.parametrize("hint", [complex, dict[str, int], tuple[object, ...]])
def test_a_type_without_a_codec_is_named(hint: Any) -> None:  # noqa: ANN401
    with pytest.raises(TypeError, match="a black box cannot hold a"):
        codec(hint)


class Lonely(NamedTuple):
    """One field alone."""

    only: Literal["a", "b"]


@dataclass(frozen=True)
class Either:
    """One of two classes."""

    one: Circle | ConvexPolygon


@pytest.mark.parametrize("value", [Lonely("b"), Either(HULLS[0]), Either(HULLS[1])])
def test_a_single_field_a_literal_and_a_choice_of_classes_come_back(value: object) -> None:
    assert_same(there_and_back(type(value), value), value)


def test_a_record_may_leave_fields_out() -> None:
    document = there(record_codec(Velocity, without=("linear_m_s",)), Velocity(1.0, 2.0))
    assert document == {"angular_rad_s": 2.0}
