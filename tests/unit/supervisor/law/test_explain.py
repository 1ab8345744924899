"""The details of a cause."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from supervisor.law.explain import bearing_in_words, detail_of
from wire.reasons import StopReason

LEFT_40 = math.radians(40)


@pytest.mark.parametrize(
    ("degrees", "words"),
    [
        (0.0, "ahead"),
        (9.4, "ahead"),
        (-9.4, "ahead"),
        (9.6, "at 10° to the left"),
        (40.0, "at 40° to the left"),
        (-40.0, "at 40° to the right"),
        (170.4, "at 170° to the left"),
        (170.6, "behind"),
        (-170.6, "behind"),
        (180.0, "behind"),
        (400.0, "at 40° to the left"),
    ],
)
def test_a_bearing_is_said_with_its_side(degrees: float, words: str) -> None:
    assert bearing_in_words(math.radians(degrees)) == words


@settings(deadline=None)
@given(st.floats())
def test_any_bearing_has_words_or_none(bearing_rad: float) -> None:
    assert bool(bearing_in_words(bearing_rad)) == math.isfinite(bearing_rad)


def test_no_cause_has_no_detail() -> None:
    assert detail_of(frozenset(), scan_problem="all NaN", block_bearing_rad=LEFT_40) == ""


@pytest.mark.parametrize(
    ("reason", "detail"),
    [
        (StopReason.SCAN_BLIND, "unseen space at 40° to the left"),
        (StopReason.OBSTACLE, "something is too close at 40° to the left"),
        (StopReason.SCAN_INVALID, "all NaN"),
        (StopReason.SCAN_STALE, ""),
    ],
)
def test_a_cause_is_explained_by_what_is_known_of_it(reason: StopReason, detail: str) -> None:
    assert detail_of(frozenset({reason}), scan_problem="all NaN", block_bearing_rad=LEFT_40) == detail


@pytest.mark.parametrize("reason", [r for r in StopReason if r is not StopReason.SENSOR_CONFLICT])
def test_what_is_not_known_is_not_said(reason: StopReason) -> None:
    assert detail_of(frozenset({reason})) == ""


def test_a_conflict_names_the_writers_of_each_lidar() -> None:
    detail = detail_of(frozenset({StopReason.SENSOR_CONFLICT}), writers=("front: a and b", "rear: c and d"))
    assert detail == "samples come from several writers: front: a and b; rear: c and d"


@pytest.mark.parametrize("reason", [StopReason.ESTOP, StopReason.ESTOP_STATION_LOST])
def test_an_estop_names_the_stations_that_are_pressed_or_missing(reason: StopReason) -> None:
    assert detail_of(frozenset({reason}), stations="door is silent") == "door is silent"


def test_of_several_causes_the_most_restrictive_is_explained() -> None:
    both = frozenset({StopReason.SCAN_INVALID, StopReason.SCAN_BLIND})
    assert detail_of(both, scan_problem="all NaN", block_bearing_rad=0.0) == "all NaN"
    both = frozenset({StopReason.ESTOP, StopReason.SCAN_INVALID})
    assert detail_of(both, scan_problem="all NaN") == ""
