"""Each profile's interpretation of readings, at its boundaries."""

import math

import numpy as np
import pytest

from supervisor.config import LidarSection, ReadingsSection
from supervisor.law.lidar import CODE_TOLERANCE_M, PROFILES, LidarProfile, explain

MIN_M, MAX_M = 0.125, 8.0  # exact in binary

HIT, FREE, UNEXPLAINED = "hit", "free", "unexplained"


def meaning(reading: float, profile: LidarProfile, range_min: float = MIN_M, range_max: float = MAX_M) -> str:
    """The meaning of one reading."""
    ranges = np.array([reading], dtype=np.float32)
    return meanings(ranges, profile, range_min, range_max)[0]


def meanings(
    ranges: np.ndarray, profile: LidarProfile, range_min: float = MIN_M, range_max: float = MAX_M
) -> list[str]:
    readings = explain(ranges, range_min, range_max, profile)
    assert not (readings.hit & ~readings.explained).any(), "a hit is explained"
    return [
        HIT if hit else FREE if explained else UNEXPLAINED
        for hit, explained in zip(readings.hit, readings.explained, strict=True)
    ]


def above(value: float) -> float:
    return float(np.nextafter(np.float32(value), np.float32(math.inf)))


def below(value: float) -> float:
    return float(np.nextafter(np.float32(value), np.float32(-math.inf)))


@pytest.mark.parametrize("name", PROFILES)
@pytest.mark.parametrize(
    ("reading", "means"),
    [
        (math.inf, FREE),
        (above(MAX_M), FREE),
        (MAX_M, FREE),
        (below(MAX_M), HIT),
        (2.0, HIT),
        (above(MIN_M), HIT),
        (MIN_M, HIT),
        (below(MIN_M), HIT),
        (0.1, HIT),
        (-1.0, HIT),
        (-math.inf, HIT),
    ],
)
def test_whatever_the_sensor_a_distance_is_a_hit_and_from_the_range_on_is_free(
    name: str, reading: float, means: str
) -> None:
    assert meaning(reading, PROFILES[name]) == means


@pytest.mark.parametrize(
    ("name", "nan", "zero"),
    [
        ("rep117", UNEXPLAINED, HIT),
        ("rplidar", UNEXPLAINED, FREE),
        ("neato_xv", FREE, FREE),
        ("hokuyo_urg", FREE, FREE),
        ("sick_lms", UNEXPLAINED, FREE),
    ],
)
def test_each_profile_s_dialect_of_nan_and_zero(name: str, nan: str, zero: str) -> None:
    assert meaning(math.nan, PROFILES[name]) == nan
    assert meaning(0.0, PROFILES[name]) == zero
    assert meaning(-0.0, PROFILES[name]) == zero


@pytest.mark.parametrize("name", PROFILES)
def test_the_least_above_zero_is_a_code_for_the_urg_alone(name: str) -> None:
    tiny = float(np.nextafter(np.float32(0.0), np.float32(1.0)))
    assert meaning(tiny, PROFILES[name]) == (FREE if name == "hokuyo_urg" else HIT)
    assert meaning(-tiny, PROFILES[name]) == HIT


@pytest.mark.parametrize("code_mm", range(20))
def test_the_urg_s_codes_are_free_up_to_19_mm(code_mm: int) -> None:
    assert meaning(code_mm / 1000, PROFILES["hokuyo_urg"], range_min=0.02) == FREE


def test_a_reading_just_beyond_the_urg_s_codes_is_too_close() -> None:
    bound = PROFILES["hokuyo_urg"].codes_below_m
    edge = np.float32(bound)
    last = edge if float(edge) < bound else np.nextafter(edge, np.float32(0.0))
    first = np.nextafter(last, np.float32(1.0))
    assert meaning(float(last), PROFILES["hokuyo_urg"]) == FREE
    assert meaning(float(first), PROFILES["hokuyo_urg"]) == HIT
    assert meaning(0.02, PROFILES["hokuyo_urg"], range_min=0.02) == HIT


@pytest.mark.parametrize(
    ("name", "code"),
    [
        ("neato_xv", 0.053),
        ("sick_lms", 50.0),
        ("sick_lms", 81.83),
        ("sick_lms", 81.9),
        ("sick_lms", 81.91),
    ],
)
def test_a_code_for_no_return_is_free_through_float32_and_not_a_tenth_of_a_millimetre_beside_it(
    name: str, code: float
) -> None:
    profile, wide = PROFILES[name], {"range_min": 0.02, "range_max": 100.0}
    assert meaning(code, profile, **wide) == FREE
    assert meaning(code - 1.1 * CODE_TOLERANCE_M, profile, **wide) == HIT
    assert meaning(code + 1.1 * CODE_TOLERANCE_M, profile, **wide) == HIT
    assert meaning(code, PROFILES["rep117"], **wide) == HIT


def test_a_code_counts_up_to_its_tolerance_and_not_at_it() -> None:
    code = LidarProfile(free_codes_m=(4.0,))
    inside = np.array([4.0, 4.0 + 0.9 * CODE_TOLERANCE_M, 4.0 - 0.9 * CODE_TOLERANCE_M])
    outside = np.array([4.0 + 1.01 * CODE_TOLERANCE_M, 4.0 - 1.01 * CODE_TOLERANCE_M])
    assert meanings(inside, code) == [FREE] * 3
    assert meanings(outside, code) == [HIT] * 2


def test_the_bound_of_codes_is_itself_no_code() -> None:
    profile = LidarProfile(codes_below_m=0.0625)
    assert meaning(0.0625, profile) == HIT
    assert meaning(below(0.0625), profile) == FREE
    assert meaning(0.0, profile) == HIT, "zero is a dialect of its own"


@pytest.mark.parametrize("reading", [-math.inf, -3.0, 0.0, 0.05, MIN_M])
def test_what_is_too_close_to_be_measured_may_be_at_the_lidar_itself(reading: float) -> None:
    readings = explain(np.array([reading], dtype=np.float32), MIN_M, MAX_M, PROFILES["rep117"])
    assert readings.hit[0]
    assert readings.distance_m[0] == (MIN_M if reading == MIN_M else 0.0)


def test_a_distance_is_kept_as_it_is() -> None:
    ranges = np.array([above(MIN_M), 1.7, MAX_M], dtype=np.float32)
    readings = explain(ranges, MIN_M, MAX_M, PROFILES["rep117"])
    assert readings.distance_m.tolist() == ranges.astype(np.float64).tolist()


@pytest.mark.parametrize("name", PROFILES)
def test_every_hit_has_a_finite_distance_within_the_range_and_the_input_is_left_alone(name: str) -> None:
    ranges = np.array(
        [math.nan, math.inf, -math.inf, 0.0, -0.0, 1e-45, 3e38, -3e38, 0.019, 0.053, 50.0, 81.83, 2.0],
        dtype=np.float32,
    )
    before = ranges.copy()
    ranges.flags.writeable = False
    readings = explain(ranges, MIN_M, MAX_M, PROFILES[name])
    found_m = readings.distance_m[readings.hit]
    assert ((found_m == 0.0) | (found_m >= MIN_M)).all()
    assert (readings.distance_m[readings.hit] <= MAX_M).all()
    assert ranges.tobytes() == before.tobytes()


def test_no_readings_mean_nothing() -> None:
    readings = explain(np.empty(0, dtype=np.float32), MIN_M, MAX_M, PROFILES["rep117"])
    assert [len(part) for part in readings] == [0, 0, 0]


def test_a_profile_of_one_s_own_is_built_from_its_parts() -> None:
    own = ReadingsSection(nan_is_free=True, codes_below_m=0.04, free_codes_m=(6.5,))
    section = LidarSection(profile="own", own=own)
    values = [math.nan, 0.03, 6.5, 0.0, 1.0]
    assert [meaning(value, section.readings()) for value in values] == [FREE, FREE, FREE, HIT, HIT]


@pytest.mark.parametrize(
    "values",
    [{"profile": "own"}, {"profile": "rep117", "own": {}}, {"profile": "own", "own": {"free_codes_m": [0]}}],
)
def test_a_profile_of_one_s_own_that_is_not_whole_is_refused(values: dict[str, object]) -> None:
    with pytest.raises(ValueError, match="own"):
        LidarSection.model_validate(values)


@pytest.mark.parametrize("name", PROFILES)
def test_every_profile_can_be_configured_by_its_name(name: str) -> None:
    assert LidarSection.model_validate({"profile": name}).readings() is PROFILES[name]
