"""The sensor faults and their syntax."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.sensor_faults import NO_FAULTS, FaultError, LidarFaults, Missing, Sector, SensorFaults, parse_faults


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
        ("blocked -0.5 0.5 nan", SensorFaults(blocked=(Sector(-0.5, 0.5),))),
        ("blocked -0.5 0.5 0.0", SensorFaults(blocked=(Sector(-0.5, 0.5, 0.0),))),
        ("blocked 0 1 -inf", SensorFaults(blocked=(Sector(0.0, 1.0, -math.inf),))),
        ("dropout 0.1", SensorFaults(dropout=Missing(0.1, math.inf))),
        ("dropout 1 0", SensorFaults(dropout=Missing(1.0, 0.0))),
        ("beams 0.02", SensorFaults(beams=Missing(0.02, math.nan))),
        ("beams 0.02 1000", SensorFaults(beams=Missing(0.02, 1000.0))),
        ("stray 0.5", SensorFaults(stray=0.5)),
        ("reach 0.6", SensorFaults(reach_m=0.6)),
        ("odom_zero", SensorFaults(odom_zero=True)),
        ("odom_freeze", SensorFaults(odom_freeze=True)),
        ("odom_scale -0.9", SensorFaults(odom_scale=-0.9)),
        ("rear:freeze", SensorFaults(only=(("rear", LidarFaults(freeze=True)),))),
        (
            "rear: dropout 0.1; stray 1; rear: blocked 0 1",
            SensorFaults(
                stray=1.0,
                only=(("rear", LidarFaults(dropout=Missing(0.1, math.inf), blocked=(Sector(0.0, 1.0),))),),
            ),
        ),
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
        ("blocked 0 101", "blocked 0 101"),
        ("blocked 0 1 -1", "blocked 0 1 -1"),
        ("blocked 0 1 1001", "blocked 0 1 1001"),
        ("blocked 0 1 free", "blocked 0 1 free"),
        ("blocked 0 1 0 0", "blocked 0 1 0 0"),
        ("dropout", "dropout"),
        ("dropout 0", "dropout 0"),
        ("dropout 1.1", "dropout 1.1"),
        ("dropout nan", "dropout nan"),
        ("beams 0.1 -1", "beams 0.1 -1"),
        ("beams 0.1 0 0", "beams 0.1 0 0"),
        ("stray 0", "stray 0"),
        ("reach 0.09", "reach 0.09"),
        ("reach inf", "reach inf"),
        ("stray 1.1", "stray 1.1"),
        ("odom_scale", "odom_scale"),
        ("odom_scale 11", "odom_scale 11"),
        ("odom_scale nan", "odom_scale nan"),
        ("blocked a b", "blocked a b"),
    ],
)
def test_what_is_no_fault_is_named_with_the_forms_that_there_are(text: str, part: str) -> None:
    with pytest.raises(FaultError) as refused:
        parse_faults(text)
    assert str(refused.value).startswith(f"{part!r} is no sensor fault; there are: none, freeze, all_nan, ")


finite = st.floats(-100.0, 100.0)
shares = st.floats(0.0, 1.0, exclude_min=True)
codes_m = st.sampled_from([math.nan, math.inf, -math.inf, 0.0]) | st.floats(0.0, 1000.0)
missing = st.none() | st.builds(Missing, shares, codes_m)
of_a_lidar = {
    "freeze": st.booleans(),
    "all_nan": st.booleans(),
    "silent": st.booleans(),
    "blocked": st.lists(
        st.builds(Sector, finite, finite, codes_m).filter(lambda s: s.start_rad != s.end_rad), max_size=3
    ).map(tuple),
    "dropout": missing,
    "beams": missing,
    "stray": st.just(0.0) | shares,
    "rate_hz": st.none() | st.floats(0.01, 500.0),
    "reach_m": st.none() | st.floats(0.1, 1000.0),
}
names = st.from_regex(r"[a-z][a-z0-9_]{0,5}", fullmatch=True)


@given(
    st.builds(
        SensorFaults,
        **of_a_lidar,
        only=st.dictionaries(
            names, st.builds(LidarFaults, **of_a_lidar).filter(lambda own: own != LidarFaults()), max_size=2
        ).map(lambda only: tuple(only.items())),
        no_odom=st.booleans(),
        odom_zero=st.booleans(),
        odom_freeze=st.booleans(),
        odom_scale=st.none() | st.floats(-10.0, 10.0),
    )
)
def test_what_is_in_force_is_said_as_it_may_be_asked_for(faults: SensorFaults) -> None:
    assert parse_faults(str(faults)) == faults


def test_a_rate_is_refused_just_below_the_least() -> None:
    """A rate of one scan in 1e322 s once divided by zero."""
    assert parse_faults("rate 0.01").rate_hz == 0.01
    for rate in (math.nextafter(0.01, 0.0), 1e-322):
        with pytest.raises(FaultError, match="rate HZ"):
            parse_faults(f"rate {rate!r}")


@pytest.mark.parametrize("text", ["rear: no_odom", "rear: frozen", "rear:", "rear: rear: freeze"])
def test_what_is_no_fault_of_a_lidar_is_none_of_a_single_one(text: str) -> None:
    with pytest.raises(FaultError, match="is no fault of a lidar"):
        parse_faults(text)


def test_a_lidar_that_there_is_not_is_refused_by_name() -> None:
    assert parse_faults("rear: freeze", ["front", "rear"]).of("rear").freeze
    with pytest.raises(FaultError, match="there is no lidar 'rear'; there are: lidar"):
        parse_faults("rear: freeze", ["lidar"])


def test_a_single_lidar_has_its_own_faults_and_those_of_all() -> None:
    faults = parse_faults("blocked 0 1; rate 5; dropout 0.1; rear: freeze; rear: blocked 2 3; rear: rate 2")
    assert faults.of("front") == LidarFaults(
        blocked=(Sector(0.0, 1.0),), rate_hz=5.0, dropout=Missing(0.1, math.inf)
    )
    assert faults.of("rear") == LidarFaults(
        freeze=True,
        blocked=(Sector(0.0, 1.0), Sector(2.0, 3.0)),
        rate_hz=2.0,
        dropout=Missing(0.1, math.inf),
    )
