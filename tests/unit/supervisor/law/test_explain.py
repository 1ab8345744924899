"""The details of a cause."""

import math

import pytest

from supervisor.law.decision import detail_of
from wire.reasons import Limit, StopReason

LEFT_40 = math.radians(40)


def test_no_cause_has_no_detail() -> None:
    assert detail_of(frozenset(), scan_problem="all NaN", block_bearing_rad=LEFT_40) == ""


@pytest.mark.parametrize(
    ("reason", "detail"),
    [
        (StopReason.SCAN_BLIND, "unseen space at 40° left"),
        (StopReason.OBSTACLE, "something is too close at 40° left"),
        (StopReason.SCAN_INVALID, "all NaN"),
        (StopReason.SCAN_STALE, ""),
    ],
)
def test_a_cause_is_explained_by_what_is_known_of_it(reason: StopReason, detail: str) -> None:
    assert detail_of(frozenset({reason}), scan_problem="all NaN", block_bearing_rad=LEFT_40) == detail


@pytest.mark.parametrize("reason", [StopReason.SCAN_BLIND, StopReason.OBSTACLE])
def test_advice_follows_what_blocks(reason: StopReason) -> None:
    detail = detail_of(frozenset({reason}), block_bearing_rad=LEFT_40, advice="turn back")
    assert detail.endswith("at 40° left; turn back")
    assert detail_of(frozenset({StopReason.SCAN_STALE}), advice="turn back") == ""


NAMING = (StopReason.SENSOR_CONFLICT, StopReason.SENSOR_MISMATCH)
"""Their causes are always known."""


@pytest.mark.parametrize("reason", [r for r in StopReason if r not in NAMING])
def test_what_is_not_known_is_not_said(reason: StopReason) -> None:
    assert detail_of(frozenset({reason})) == ""


def test_a_conflict_names_the_writers_of_each_lidar() -> None:
    detail = detail_of(frozenset({StopReason.SENSOR_CONFLICT}), writers=("front: a and b", "rear: c and d"))
    assert detail == "samples come from several writers: front: a and b; rear: c and d"


def test_a_mismatch_names_what_motion_shows() -> None:
    detail = detail_of(frozenset({StopReason.SENSOR_MISMATCH}), mismatch="a mirrored lidar")
    assert detail == "motion shows a mirrored lidar"


@pytest.mark.parametrize("reason", [StopReason.ESTOP, StopReason.ESTOP_STATION_LOST])
def test_an_estop_names_the_stations_that_are_pressed_or_missing(reason: StopReason) -> None:
    assert detail_of(frozenset({reason}), stations="door is silent") == "door is silent"


def test_of_several_causes_the_most_restrictive_is_explained() -> None:
    both = frozenset({StopReason.SCAN_INVALID, StopReason.SCAN_BLIND})
    assert detail_of(both, scan_problem="all NaN", block_bearing_rad=0.0) == "all NaN"
    both = frozenset({StopReason.ESTOP, StopReason.SCAN_INVALID})
    assert detail_of(both, scan_problem="all NaN") == ""


def test_in_the_open_the_speed_is_named() -> None:
    assert (
        detail_of(frozenset(), Limit.IN_THE_OPEN, open_m_s=0.25)
        == "open_m_s permits 0.25 m/s while a lidar is silent"
    )


def test_a_limit_is_explained_only_where_nothing_stops_the_motion() -> None:
    assert detail_of(frozenset(), Limit.BASE_WEAK, weakness="the base is weak") == "the base is weak"
    assert "0.4 m/s" in detail_of(frozenset(), Limit.BASE_UNMEASURED)
    cause = frozenset({StopReason.OBSTACLE})
    assert detail_of(cause, Limit.BASE_UNMEASURED, block_bearing_rad=0.0).startswith("something is too close")
    assert detail_of(cause, Limit.BASE_WEAK, block_bearing_rad=0.0).startswith("something is too close")
