"""The supervisor trusts a base with no more deceleration than `[sim]` of the same file gives it."""

import math
from typing import Any

import pytest

from supervisor.config import SupervisorSection, fit_to_base
from wire.host.config import BaseSection, ConfigError, Sections, read_sections


def read(supervisor: dict[str, Any], sim: dict[str, Any]) -> Sections:
    return read_sections(
        {"supervisor": supervisor, "sim": sim},
        {"supervisor": SupervisorSection, "sim": BaseSection},
        fit_to_base,
    )


def refusal(supervisor: dict[str, Any], sim: dict[str, Any]) -> str:
    with pytest.raises(ConfigError) as caught:
        read(supervisor, sim)
    return str(caught.value)


JUST_ABOVE = math.nextafter(1.5, 2.0)


@pytest.mark.parametrize(
    ("supervisor", "sim", "fault"),
    [
        ({"deceleration_m_s2": JUST_ABOVE}, {"braking_m_s2": 1.5}, "supervisor.deceleration_m_s2 = 1.5000"),
        (
            {"deceleration_m_s2": JUST_ABOVE, "footprint": {"radius_m": 0.25}},
            {"angular_braking_rad_s2": 6.0},
            "set at most 1.5",
        ),
        (
            {"base_acceleration_m_s2": JUST_ABOVE},
            {"acceleration_m_s2": 1.5},
            "is more than the base does, [sim] acceleration_m_s2 = 1.5: set at most 1.5",
        ),
        (
            {"base_angular_acceleration_rad_s2": JUST_ABOVE},
            {"angular_acceleration_rad_s2": 1.5},
            "is more than the base does, [sim] angular_acceleration_rad_s2 = 1.5",
        ),
        (
            {"tick_hz": 16.0, "transport_s": 0.1},
            {"command_timeout_s": math.nextafter(0.125, 0.0)},
            "the base brakes between two commands: set 0.125",
        ),
        (
            {"base_timeout_s": math.nextafter(0.3, 0.0)},
            {"command_timeout_s": 0.3},
            "is less than the base's own, [sim] command_timeout_s = 0.3: set at least 0.3",
        ),
        (
            {"odom_timeout_s": math.nextafter(0.1875, 0.0)},
            {"odom_hz": 8.0},
            "must be at least 1.5 periods of [sim] odom_hz = 8: set 0.1875",
        ),
        (
            {"scan_timeout_s": 0.1874},
            {"scan_hz": 8.0},
            "supervisor.scan_timeout_s = 0.1874: [sim] scan_hz = 8: must be at least 1.5 scan periods of 0.125 s",
        ),
    ],
)
def test_what_does_not_fit_to_the_base_is_refused_with_what_would(
    supervisor: dict[str, Any], sim: dict[str, Any], fault: str
) -> None:
    assert fault in refusal(supervisor, sim)


@pytest.mark.parametrize(
    ("supervisor", "sim"),
    [
        ({}, {}),
        ({"deceleration_m_s2": 1.5}, {"braking_m_s2": 1.5}),
        ({"deceleration_m_s2": 1.5, "footprint": {"radius_m": 0.25}}, {"angular_braking_rad_s2": 6.0}),
        ({"base_acceleration_m_s2": 1.5}, {"acceleration_m_s2": 1.5}),
        ({"base_angular_acceleration_rad_s2": 1.5}, {"angular_acceleration_rad_s2": 1.5}),
        ({"tick_hz": 16.0, "transport_s": 0.1}, {"command_timeout_s": 0.125}),
        ({"base_timeout_s": 0.3}, {"command_timeout_s": 0.3}),
        ({"odom_timeout_s": 0.1875}, {"odom_hz": 8.0}),
        ({"odom_timeout_s": 0.1, "odometry": False}, {"odom_hz": 8.0}),
        ({"scan_timeout_s": 0.1875}, {"scan_hz": 8.0}),
    ],
)
def test_what_just_fits_is_accepted(supervisor: dict[str, Any], sim: dict[str, Any]) -> None:
    assert read(supervisor, sim)[SupervisorSection]


def test_each_of_several_lidars_is_held_to_the_rate_of_the_base() -> None:
    lidars = [{"name": "front", "topic": "scan"}, {"name": "rear", "topic": "back", "timeout_s": 0.1}]
    message = refusal({"lidars": lidars}, {"scan_hz": 10.0})
    assert "supervisor.lidars.1.timeout_s = 0.1: [sim] scan_hz = 10: must be at least" in message


def test_a_file_without_a_base_is_the_supervisors_alone() -> None:
    document = {"supervisor": {"deceleration_m_s2": 9.0}}
    assert read_sections(document, {"supervisor": SupervisorSection}, fit_to_base)[SupervisorSection]


def test_the_base_section_takes_no_offence_at_the_other_keys_of_sim() -> None:
    assert read({}, {"scene": "aisle", "braking_m_s2": 3.0})[BaseSection].braking_m_s2 == 3.0


def test_the_faults_of_both_sections_are_named_in_one_pass() -> None:
    message = refusal({"tick_hz": 0.0}, {"braking_m_s2": 1e9})
    assert "supervisor.tick_hz = 0.0" in message
    assert "sim.braking_m_s2 = 1000000000.0" in message
