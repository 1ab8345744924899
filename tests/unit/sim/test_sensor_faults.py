"""The sensors' faults: what may be asked for, and what becomes of the ranges."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.sensor_faults import NO_FAULTS, FaultError, Sector, SensorFaults, parse_faults, spoil

ANGLES_RAD = np.deg2rad(np.arange(-180.0, 180.0))
RANGES = np.full(360, 2.0, dtype=np.float32)


@pytest.mark.parametrize(
    ("text", "faults"),
    [
        ("none", NO_FAULTS),
        (" none ", NO_FAULTS),
        ("freeze", SensorFaults(freeze=True)),
        ("all_nan", SensorFaults(all_nan=True)),
        ("silent", SensorFaults(silent=True)),
        ("no_odom", SensorFaults(no_odom=True)),
        ("rate 2.5", SensorFaults(rate_hz=2.5)),
        ("rate 500", SensorFaults(rate_hz=500.0)),
        ("blocked -0.5 0.5", SensorFaults(blocked=(Sector(-0.5, 0.5),))),
        (
            "freeze; no_odom;blocked 0 1; blocked 2 -2; rate 5",
            SensorFaults(
                freeze=True, no_odom=True, rate_hz=5.0, blocked=(Sector(0.0, 1.0), Sector(2.0, -2.0))
            ),
        ),
    ],
)
def test_faults_read_as_they_are_written(text: str, faults: SensorFaults) -> None:
    assert parse_faults(text) == faults


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("", ""),
        ("frozen", "frozen"),
        ("none; freeze", "none"),
        ("freeze;", ""),
        ("freeze 1", "freeze 1"),
        ("rate", "rate"),
        ("rate 0", "rate 0"),
        ("rate -1", "rate -1"),
        ("rate 501", "rate 501"),
        ("rate nan", "rate nan"),
        ("rate fast", "rate fast"),
        ("blocked 1", "blocked 1"),
        ("blocked 1 1", "blocked 1 1"),
        ("blocked 0 inf", "blocked 0 inf"),
        ("blocked a b", "blocked a b"),
    ],
)
def test_what_is_no_fault_is_named_with_the_forms_that_there_are(text: str, part: str) -> None:
    with pytest.raises(FaultError) as refused:
        parse_faults(text)
    assert str(refused.value).startswith(f"{part!r} is no sensor fault; there are: none, freeze, all_nan, ")


angle_rad = st.integers(-60, 60).map(lambda tenths: tenths / 10)


@given(
    st.builds(
        SensorFaults,
        freeze=st.booleans(),
        all_nan=st.booleans(),
        silent=st.booleans(),
        no_odom=st.booleans(),
        rate_hz=st.none() | st.integers(1, 500).map(float),
        blocked=st.lists(
            st.tuples(angle_rad, angle_rad).filter(lambda s: s[0] != s[1]).map(lambda s: Sector(*s)),
            max_size=3,
        ).map(tuple),
    )
)
def test_what_is_in_force_is_said_as_it_may_be_asked_for(faults: SensorFaults) -> None:
    assert parse_faults(str(faults)) == faults


def test_no_faults_change_nothing() -> None:
    np.testing.assert_array_equal(spoil(NO_FAULTS, RANGES, ANGLES_RAD), RANGES)


def test_all_nan_leaves_no_reading() -> None:
    spoiled = spoil(parse_faults("all_nan; blocked 0 1"), RANGES, ANGLES_RAD)
    assert spoiled.dtype == np.float32
    assert np.isnan(spoiled).all()


def blocked_deg(text: str) -> list[int]:
    spoiled = spoil(parse_faults(text), RANGES, ANGLES_RAD)
    assert spoiled.dtype == np.float32
    assert np.all(np.isnan(spoiled) | (spoiled == 2.0))
    return [round(math.degrees(angle)) for angle in ANGLES_RAD[np.isnan(spoiled)]]


def test_a_blocked_sector_goes_counter_clockwise_and_its_edges_are_in_it() -> None:
    quarter_rad = math.pi / 2
    assert blocked_deg(f"blocked 0 {quarter_rad}") == list(range(91))
    assert blocked_deg(f"blocked {quarter_rad} 0") == [*range(-180, 1), *range(90, 180)]


def test_a_blocked_sector_may_lie_across_the_seam_behind() -> None:
    assert blocked_deg("blocked 3.1 -3.1") == [-180, -179, -178, 178, 179]


def test_a_sector_as_wide_as_a_turn_blocks_everything() -> None:
    assert len(blocked_deg("blocked -4 4")) == 360


def test_several_sectors_are_blocked_together() -> None:
    assert blocked_deg("blocked -0.01 0.01; blocked 1.56 1.58") == [0, 90]


def test_the_true_ranges_are_left_as_they_are() -> None:
    ranges = RANGES.copy()
    spoil(parse_faults("blocked -1 1"), ranges, ANGLES_RAD)
    spoil(parse_faults("all_nan"), ranges, ANGLES_RAD)
    np.testing.assert_array_equal(ranges, RANGES)


def test_a_rate_is_refused_just_below_the_least() -> None:
    """One scan in 1e322 s divided by zero."""
    assert parse_faults("rate 0.01").rate_hz == 0.01
    for rate in (math.nextafter(0.01, 0.0), 1e-322):
        with pytest.raises(FaultError, match="rate HZ"):
            parse_faults(f"rate {rate!r}")
