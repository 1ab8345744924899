"""`[supervisor]`: numbers that are valid alone but contradict each other."""

import math
import tomllib
from typing import Any

import pytest

from supervisor.config import SupervisorSection, is_base_known
from supervisor.law.lidar import PROFILES, TIMINGS
from supervisor.law.scan import Mount
from wire.host.config import TAKEN_NAMES, ConfigError, section


def load(**values: object) -> SupervisorSection:
    return section({"supervisor": values}, "supervisor", SupervisorSection)


def refusal(**values: object) -> str:
    with pytest.raises(ConfigError) as caught:
        load(**values)
    return str(caught.value)


def listed(*lidars: dict[str, object]) -> dict[str, Any]:
    return {"lidars": list(lidars)}


FRONT: dict[str, object] = {"name": "front", "topic": "scan"}
REAR: dict[str, object] = {"name": "rear", "topic": "scan_rear"}


@pytest.mark.parametrize(
    "key", ["command_timeout_s", "scan_timeout_s", "odom_timeout_s", "overrun_s", "base_timeout_s"]
)
def test_a_timeout_is_longer_than_a_tick(key: str) -> None:
    slow: dict[str, Any] = {"tick_hz": 16.0, "transport_s": 0.1}  # 1/16 s is exact in binary
    assert f"supervisor.{key} = 0.0625: must be longer than a tick of 0.0625 s" in refusal(
        **slow, **{key: 0.0625}
    )
    assert getattr(load(**slow, **{key: math.nextafter(0.0625, 1.0)}), key) > 0.0625


def test_a_lidars_own_timeout_is_longer_than_a_tick() -> None:
    slow: dict[str, Any] = {"tick_hz": 16.0, "transport_s": 0.1}
    assert "supervisor.lidar.timeout_s = 0.0625: must be longer" in refusal(
        **slow, lidar={"timeout_s": 0.0625}
    )
    assert load(**slow, lidar={"timeout_s": math.nextafter(0.0625, 1.0)})


@pytest.mark.parametrize("latency_s", [-0.001, 0.501, math.nan, math.inf])
def test_a_latency_is_a_time_that_a_lidar_may_have(latency_s: float) -> None:
    assert "supervisor.lidar.latency_s" in refusal(scan_timeout_s=1.0, lidar={"latency_s": latency_s})


def test_a_lidar_may_be_mounted_upside_down() -> None:
    assert load(lidar={"flip": True, "yaw_rad": 0.5}).law().lidars[0].mount == Mount(yaw_rad=0.5, flip=True)
    assert not load().law().lidars[0].mount.flip
    assert "supervisor.lidar.flip" in refusal(lidar={"flip": 1})


def test_the_open_has_a_speed_of_its_own() -> None:
    assert load(open_m_s=0.3).law().open_m_s == 0.3
    assert load().law().open_m_s == 0.5
    for open_m_s in (0.0, 0.049, 1.01, math.nan, math.inf):
        assert "supervisor.open_m_s" in refusal(open_m_s=open_m_s)


def test_a_scan_is_not_too_old_when_it_arrives() -> None:
    assert load(lidar={"latency_s": math.nextafter(0.24, 0.0)})
    message = refusal(lidar={"latency_s": 0.24})
    assert "supervisor.lidar.latency_s = 0.24: must be less than the scan timeout of 0.24 s" in message


def test_the_timeout_of_a_lidar_with_latency_is_longer_by_it() -> None:
    lidar = {"period_s": 0.125, "latency_s": 0.0625}
    assert load(scan_timeout_s=0.25, lidar=lidar)
    message = refusal(scan_timeout_s=math.nextafter(0.25, 0.0) - 1e-6, lidar=lidar)
    assert "at least 1.5 scan periods of 0.125 s and latency_s = 0.0625" in message


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("base_dead_time_s", -0.001),
        ("base_dead_time_s", 0.501),
        ("base_dead_time_s", math.nan),
        ("base_timeout_s", 0.019),
        ("base_timeout_s", 2.001),
        ("base_timeout_s", math.inf),
    ],
)
def test_values_that_no_base_has_are_refused(key: str, value: float) -> None:
    assert f"supervisor.{key}" in refusal(**{key: value})


def test_timeout_dead_time_and_latency_reach_the_law() -> None:
    law = load(base_dead_time_s=0.1, base_timeout_s=0.5, lidar={"latency_s": 0.05}).law()
    assert (law.base_dead_time_s, law.base_timeout_s, law.lidars[0].latency_s) == (0.1, 0.5, 0.05)
    assert law.shown_m_s2 == math.inf


@pytest.mark.parametrize(
    ("toml", "is_known"),
    [
        ("", True),
        ("[bus]\nnamespace = 'r1'", True),
        ("[supervisor]\nstop_distance_m = 0.4", False),
        ("[supervisor]", False),
        ("[ros2]\nscan = 'scan'", False),
        ("[supervisor]\ndeceleration_m_s2 = 1.5", True),
        ("[supervisor]\ndeceleration_m_s2 = 1.5\n[ros2]", True),
        ("[supervisor]\nstop_distance_m = 0.4\n[sim]", True),
        ("[ros2]\n[sim]", True),
    ],
)
def test_a_file_that_describes_a_robot_without_its_brakes_leaves_the_base_unknown(
    toml: str, *, is_known: bool
) -> None:
    assert is_base_known(tomllib.loads(toml)) is is_known
    law = SupervisorSection().law(is_base_known=is_known)
    assert law.unmeasured_m_s == (math.inf if is_known else 0.5)


def test_the_time_for_transport_includes_a_tick() -> None:
    assert load(tick_hz=32.0, transport_s=0.03125).transport_s == 0.03125
    message = refusal(tick_hz=32.0, transport_s=math.nextafter(0.03125, 0.0))
    assert "supervisor.transport_s" in message
    assert "at least a tick of 0.03125 s" in message


def test_a_command_at_half_its_timeout_permits_the_minimum_useful_speed() -> None:
    assert (
        "supervisor.blind_budget_m = 0.01: permits less than creep_m_s = 0.02 once a command is half as old as "
        "command_timeout_s = 2: set at least 0.0407, or a shorter timeout"
    ) in refusal(command_timeout_s=2.0, blind_budget_m=0.01)
    assert load(command_timeout_s=2.0, blind_budget_m=0.0407)


def test_the_warning_comes_no_later_than_the_stop() -> None:
    assert load(stop_distance_m=0.4, warning_distance_m=0.4)
    message = refusal(stop_distance_m=0.4, warning_distance_m=math.nextafter(0.4, 0.0))
    assert "must not be less than stop_distance_m = 0.4" in message


@pytest.mark.parametrize(
    ("key", "limit", "most"),
    [
        ("creep_m_s", "max_linear_m_s", 0.0625),
        ("blind_creep_m_s", "max_linear_m_s", 0.125),
        ("runaway_linear_m_s", "max_linear_m_s", 0.25),
        ("runaway_angular_rad_s", "max_angular_rad_s", 0.5),
    ],
)
def test_a_threshold_is_below_the_speed_limit(key: str, limit: str, most: float) -> None:
    small: dict[str, Any] = {"creep_m_s": 0.01, "runaway_linear_m_s": 0.01, "runaway_angular_rad_s": 0.01}
    message = refusal(**{**small, key: most, limit: most})
    assert f"supervisor.{key} = {most!r}: must be less than {limit} = {most:g}" in message
    assert load(**{**small, key: math.nextafter(most, 0.0), limit: most})


def test_a_lidar_is_part_of_the_robot_and_within_its_footprint() -> None:
    assert load(footprint={"radius_m": 0.25}, lidar={"x_m": -0.265})
    message = refusal(footprint={"radius_m": 0.25}, lidar={"x_m": -0.28})
    assert "supervisor.lidar.x_m = -0.28: puts the lidar 0.03 m outside the footprint" in message
    assert "make the footprint include the lidar" in message
    assert "supervisor.lidars.1.y_m = 5.0" in refusal(**listed(FRONT, {**REAR, "x_m": 0.1, "y_m": 5.0}))


def test_what_counts_as_a_code_is_nearer_than_the_stop_distance() -> None:
    own = {"profile": "own", "own": {"codes_below_m": 0.25}}
    assert "supervisor.lidar.own.codes_below_m = 0.25: must be less than stop_distance_m" in refusal(
        stop_distance_m=0.25, lidar=own
    )
    assert load(stop_distance_m=math.nextafter(0.25, 1.0), lidar=own)


def test_a_lidar_has_the_beams_that_are_asked_of_it() -> None:
    assert load(lidar={"beams": 90})
    assert "supervisor.lidar.beams = 89: is less than min_beams = 90" in refusal(lidar={"beams": 89})


@pytest.mark.parametrize(
    ("view", "is_valid"),
    [
        ([-math.pi, math.pi], True),
        ([0.0, 0.1], True),
        ([0.1, 0.1], False),
        ([0.2, 0.1], False),
        ([-math.pi, math.pi + 0.01], False),
    ],
)
def test_a_view_is_a_part_of_a_turn(view: list[float], is_valid: bool) -> None:  # noqa: FBT001 - a table
    if is_valid:
        assert load(lidar={"view_rad": view}).lidar.view_rad == tuple(view)
    else:
        assert f"supervisor.lidar.view_rad = {view}: must be" in refusal(lidar={"view_rad": view})


def test_all_contradictions_are_named_at_once() -> None:
    message = refusal(command_timeout_s=0.03, tick_hz=20.0, warning_distance_m=0.1, lidar={"x_m": 5.0})
    for key in ("command_timeout_s", "transport_s", "warning_distance_m", "lidar.x_m"):
        assert f"supervisor.{key} = " in message


# --- timeouts and periods


@pytest.mark.parametrize("profile", TIMINGS)
def test_a_sensors_profile_brings_its_timeout(profile: str) -> None:
    config = load(lidar={"profile": profile})
    timing = TIMINGS[profile]
    assert config.law().lidars[0].timeout_s == timing.timeout_s + timing.latency_s
    assert config.lidar.usual_period_s() == timing.usual_period_s
    assert timing.timeout_s >= 1.5 * timing.usual_period_s


@pytest.mark.parametrize("profile", TIMINGS)
def test_a_rotating_lidar_is_as_late_as_half_of_its_turn_unless_the_configuration_says_otherwise(
    profile: str,
) -> None:
    """The timeout of the configuration counts from the message; with `latency_s`, from the measurement."""
    timing = TIMINGS[profile]
    (lidar,) = load(lidar={"profile": profile, "timeout_s": 0.5}).law().lidars
    assert (lidar.latency_s, lidar.timeout_s) == (timing.latency_s, 0.5 + timing.latency_s)
    assert 0.25 * timing.usual_period_s < timing.latency_s <= 0.5 * timing.usual_period_s
    (lidar,) = load(lidar={"profile": profile, "timeout_s": 0.5, "latency_s": 0.02}).law().lidars
    assert (lidar.latency_s, lidar.timeout_s) == (0.02, 0.5)


def test_every_profile_that_names_a_sensor_has_its_timing() -> None:
    assert set(PROFILES) - set(TIMINGS) == {"rep117"}
    assert load(lidar={"profile": "rep117"}).law().lidars[0].timeout_s == 0.24


def test_a_neato_at_its_own_rate_is_not_stale() -> None:
    assert load(lidar={"profile": "neato_xv"}).law().lidars[0].timeout_s == pytest.approx(0.55)


def test_a_timeout_that_is_given_counts_before_the_profiles_and_the_lidars_own_before_both() -> None:
    neato = {"profile": "neato_xv"}
    assert load(scan_timeout_s=0.4, lidar=neato).law().lidars[0].timeout_s == 0.5
    assert (
        load(scan_timeout_s=0.4, lidar={**neato, "timeout_s": 0.35}).law().lidars[0].timeout_s == 0.35 + 0.1
    )


def test_a_timeout_is_at_least_one_and_a_half_periods() -> None:
    assert load(lidar={"period_s": 0.125, "timeout_s": 0.1875})
    message = refusal(lidar={"period_s": 0.125, "timeout_s": 0.1874})
    assert "supervisor.lidar.timeout_s = 0.1874: must be at least 1.5 scan periods of 0.125 s" in message
    assert "set 0.1875" in message


def test_the_default_timeout_written_out_is_refused_for_a_sensor_that_is_slower() -> None:
    message = refusal(scan_timeout_s=0.24, lidar={"profile": "neato_xv"})
    assert "supervisor.scan_timeout_s = 0.24: must be at least 1.5 scan periods of 0.2 s" in message
    assert "set 0.3, or leave it out for the 0.45 s of neato_xv" in message


# --- several lidars


def test_one_lidar_is_called_lidar_and_is_on_scan() -> None:
    (lidar,) = load(lidar={"x_m": 0.1, "profile": "rplidar"}).all_lidars()
    assert (lidar.name, lidar.topic, lidar.x_m, lidar.profile) == ("lidar", "scan", 0.1, "rplidar")


def test_several_lidars_are_listed_with_their_own_timeouts() -> None:
    config = load(**listed({**FRONT, "profile": "sick_lms"}, {**REAR, "profile": "rplidar", "x_m": -0.2}))
    assert [(lidar.name, lidar.topic) for lidar in config.all_lidars()] == [
        ("front", "scan"),
        ("rear", "scan_rear"),
    ]
    assert [config.scan_timeout_of(lidar) for lidar in config.all_lidars()] == [0.24, 0.45]


def test_either_one_lidar_or_several_are_given() -> None:
    assert "supervisor.lidar: give either [supervisor.lidar] or [[supervisor.lidars]]" in refusal(
        lidar={"x_m": 0.0}, **listed(FRONT)
    )


def test_a_contradiction_in_a_list_is_named_by_its_index() -> None:
    message = refusal(**listed(FRONT, {**REAR, "period_s": 0.2, "timeout_s": 0.2}))
    assert "supervisor.lidars.1.timeout_s = 0.2: must be at least" in message


@pytest.mark.parametrize(
    ("lidars", "fault"),
    [
        ([], "supervisor.lidars = []"),
        ([{**FRONT, "name": f"n{i}", "topic": f"t{i}"} for i in range(5)], "supervisor.lidars = "),
        ([FRONT, {**REAR, "name": "front"}], "supervisor.lidars.1.name = 'front': each lidar needs a name"),
        (
            [{**FRONT, "topic": "left"}, {**REAR, "topic": "left"}],
            "supervisor.lidars.1.topic = 'left': each lidar needs a topic",
        ),
        ([REAR, FRONT], "supervisor.lidars.1.topic = 'scan': only the first lidar"),
        ([{**FRONT, "topic": "joy"}], "supervisor.lidars.0.topic = 'joy': is a command source"),
        ([{**FRONT, "topic": "robot/scan"}], "supervisor.lidars.0.topic = 'robot/scan': "),
        ([{"name": "front"}], "supervisor.lidars.0.topic: is missing"),
    ],
)
def test_a_list_that_makes_no_sense_is_refused(lidars: list[dict[str, object]], fault: str) -> None:
    assert fault in refusal(lidars=lidars)


# --- names


def test_the_names_that_are_taken_are_those_of_the_wire() -> None:
    assert {"supervisor", "sim", "alive", "estop", "scan", "odom", "cmd_vel", "imu"} <= TAKEN_NAMES
    assert "teleop" not in TAKEN_NAMES  # a node, and the command source of the same name


@pytest.mark.parametrize("name", sorted(TAKEN_NAMES))
def test_a_source_shadows_no_node_and_no_topic(name: str) -> None:
    message = refusal(sources=[{"name": name, "priority": 1}])
    assert f"supervisor.sources.0.name = {name!r}: is a node or a topic of the wire" in message


@pytest.mark.parametrize("topic", sorted(TAKEN_NAMES - {"scan"}))
def test_a_lidar_shadows_no_node_and_no_other_topic(topic: str) -> None:
    assert f"supervisor.lidars.0.topic = {topic!r}: is a node" in refusal(**listed({**FRONT, "topic": topic}))


def test_two_sources_of_one_name_are_refused_by_their_place() -> None:
    source = {"name": "a", "priority": 1}
    assert "supervisor.sources.1.name = 'a': each source needs a name" in refusal(sources=[source, source])


@pytest.mark.parametrize("key", ["teleop/**", "joy/other", "scan/**", "scan"])
def test_another_key_must_not_begin_like_a_source_or_a_lidar(key: str) -> None:
    with pytest.raises(ConfigError, match="more_keys"):
        SupervisorSection().contract([key])


def test_the_contract_names_the_sources_the_lidars_and_the_other_keys() -> None:
    contract = SupervisorSection().contract(["camera/**"])
    assert contract.sources == ("teleop", "joy", "path")
    assert (contract.lidars, contract.more_keys) == (("scan",), ("camera/**",))
