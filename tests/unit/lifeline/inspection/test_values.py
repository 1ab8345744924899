"""Messages as YAML, CSV and fields, and YAML as messages."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from deploy.stack.formatting import number
from lifeline.inspection.values import (
    MAX_YAML,
    ValueRefusedError,
    csv_line,
    finite,
    from_yaml,
    leaves,
    plain_value,
    select,
    to_yaml,
)
from wire.messages import Bool, LaserScan, SafetyStatus, Twist, header, laser_scan, planar_twist


def scan() -> LaserScan:
    ranges = np.array([1.5, math.inf, math.nan], dtype=np.float32)
    return laser_scan(ranges, range_m=(0.1, 10.0), period_s=0.05, time_ns=0)


def test_a_message_prints_as_yaml_like_in_ros_2() -> None:
    assert to_yaml(plain_value(planar_twist(0.5, -0.1))) == (
        "linear: {x: 0.5, y: 0.0, z: 0.0}\nangular: {x: 0.0, y: 0.0, z: -0.1}\n"
    )
    assert "ranges: [1.5, .inf, .nan]" in to_yaml(plain_value(scan()))
    assert to_yaml(0.25) == "0.25\n"
    assert to_yaml(math.nan) == ".nan\n"
    assert to_yaml(value=True) == "true\n"


@pytest.mark.parametrize(("path", "value"), [("linear.x", 0.5), ("angular", {"x": 0.0, "y": 0.0, "z": 0.0})])
def test_a_field_is_selected_by_its_path(path: str, value: object) -> None:
    assert select(plain_value(planar_twist(0.5, 0.0)), path) == value


def test_an_element_is_selected_by_its_index() -> None:
    assert select(plain_value(scan()), "ranges.0") == 1.5


@pytest.mark.parametrize(
    "path", ["linear.w", "ranges.3", "ranges.x", "ranges.-1", "linear.x.y", "", "range_min.0"]
)
def test_a_field_that_does_not_exist_is_refused(path: str) -> None:
    value = plain_value(scan()) if path.startswith("range") else plain_value(planar_twist(0.0, 0.0))
    with pytest.raises(ValueRefusedError):
        select(value, path)


def test_no_text_of_a_message_can_control_the_terminal() -> None:
    status = SafetyStatus(header("\x1b[2J"), detail="a\x07b", owner="\x9b31m")
    assert not any(char in to_yaml(plain_value(status)) for char in "\x1b\x07\x9b")


def test_a_message_prints_as_csv_with_the_paths_of_its_values() -> None:
    rows = list(leaves(plain_value(planar_twist(0.5, 0.0))))
    assert csv_line([name for name, _ in rows]) == "linear.x,linear.y,linear.z,angular.x,angular.y,angular.z"
    assert csv_line([value for _, value in rows]) == "0.5,0.0,0.0,0.0,0.0,0.0"


def test_json_gets_null_instead_of_nan() -> None:
    assert select(finite(plain_value(scan())), "ranges") == [1.5, None, None]
    assert (number(math.nan), number(math.inf), number(0.12345678)) == (None, None, 0.1235)


def test_fields_that_yaml_does_not_give_are_zero() -> None:
    assert from_yaml("{linear: {x: 0.1}}", Twist) == planar_twist(0.1, 0.0)
    assert from_yaml("angular:\n  z: 1", Twist) == planar_twist(0.0, 1.0)
    assert from_yaml("", Twist) == planar_twist(0.0, 0.0)
    assert from_yaml("data: true", Bool) == Bool(data=True)


@pytest.mark.parametrize(
    "text",
    [
        "a: [",
        "linear: 3",
        "linear: {x: .nan}",
        "linear: {x: .inf}",
        "linear: {x: 1e999}",
        "linear: {x: true}",
        "linear: {x: '1'}",
        "linear: {w: 1}",
        "[1, 2]",
        "&a [*a]",
        "a: &a [*a, *a]",
        "!!python/object:os.system x",
        "linear: {x: " + "9" * 400 + "}",
        "[" * 500,
        "x" * (MAX_YAML + 1),
    ],
)
def test_yaml_that_is_no_message_is_refused_with_a_sentence(text: str) -> None:
    with pytest.raises(ValueRefusedError, match=r"\w"):
        from_yaml(text, Twist)


def test_a_message_that_nobody_should_type_cannot_be_published() -> None:
    with pytest.raises(ValueRefusedError, match="LaserScan cannot be published"):
        from_yaml("{}", LaserScan)


@given(st.text(max_size=60))
def test_any_text_is_a_message_or_is_refused(text: str) -> None:
    try:
        message = from_yaml(text, Twist)
    except ValueRefusedError:
        return
    assert all(math.isfinite(value) for _, value in leaves(plain_value(message)))  # type: ignore[arg-type]


@pytest.mark.parametrize("text", ["!!bool x", "!!int ''", "{linear: {x: !!int ''}}"])
def test_a_tag_that_does_not_fit_its_value_is_refused(text: str) -> None:
    with pytest.raises(ValueRefusedError, match="not YAML"):
        from_yaml(text, Twist)
