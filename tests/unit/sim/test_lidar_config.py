"""`[[sim.lidars]]`: what it makes of the configuration, and what it refuses."""

import math
import tomllib
from typing import Any

import pytest

from sim.config import SimSection
from sim.lidar_config import MAX_LIDARS, LidarConfig
from wire.host.config import ConfigError, section

DIAGONAL = """
[[sim.lidars]]
name = "front"
topic = "scan"
x_m = 0.3
y_m = 0.2
yaw_rad = 0.785398
beams = 811
span_rad = 4.712389
range_min_m = 0.05
range_max_m = 25.0
noise_m = 0.01
dropout = 0.001

[[sim.lidars]]
name = "rear"
topic = "scan_rear"
x_m = -0.3
y_m = -0.2
yaw_rad = -2.356194
span_rad = 4.712389
"""


def read(document: dict[str, Any]) -> SimSection:
    return section(document, "sim", SimSection)


def lidars(**changed: object) -> dict[str, Any]:
    """A document whose second lidar is changed."""
    document = tomllib.loads(DIAGONAL)
    document["sim"]["lidars"][1] |= changed
    return document


def test_every_key_of_a_lidar_reaches_its_model() -> None:
    front, rear = read(tomllib.loads(DIAGONAL)).lidar_configs()
    assert front.model_dump() == dict(
        LidarConfig(
            beams=811,
            range_min_m=0.05,
            range_max_m=25.0,
            noise_m=0.01,
            span_rad=4.712389,
            dropout=0.001,
            x_m=0.3,
            y_m=0.2,
            yaw_rad=0.785398,
            name="front",
            topic="scan",
        )
    )
    assert rear.model_dump() == dict(
        LidarConfig(
            noise_m=0.002,
            span_rad=4.712389,
            x_m=-0.3,
            y_m=-0.2,
            yaw_rad=-2.356194,
            name="rear",
            topic="scan_rear",
        )
    )


def test_without_a_list_the_lidar_keys_make_the_one_lidar_on_scan() -> None:
    config = SimSection(lidar_beams=500, lidar_noise_m=0.01)
    assert config.lidar_configs() == (config.lidar(),)
    assert (config.lidar().name, config.lidar().topic, config.lidar().beams) == ("lidar", "scan", 500)


@pytest.mark.parametrize(
    ("key", "value", "why"),
    [
        ("name", "Rear", "pattern"),
        ("topic", "/scan_rear", "relative key"),
        ("topic", "scan rear", "relative key"),
        ("topic", "a" * 65, "relative key"),
        ("topic", "odom", "already used"),
        ("topic", "cmd_vel", "already used"),
        ("topic", "teleop/cmd_vel", "already used"),
        ("topic", "supervisor/scan", "already used"),
        ("topic", "alive/scan", "already used"),
        ("x_m", 2.1, "must be from -2 to 2"),
        ("y_m", -2.1, "must be from -2 to 2"),
        ("yaw_rad", 6.3, "in rad, not in degrees"),
        ("yaw_rad", math.nan, "in rad, not in degrees"),
        ("beams", 0, "must be from 1 to 65536"),
        ("beams", 65_537, "must be from 1 to 65536"),
        ("span_rad", 0.0, r"must be from 0\.01 to 6\.28"),
        ("span_rad", 6.3, r"must be from 0\.01 to 6\.28"),
        ("range_min_m", -0.1, "must be from 0 to 10"),
        ("range_min_m", 10.1, "must be from 0 to 10"),
        ("range_max_m", 0.01, r"must be from 0\.05 to 1000"),
        ("range_max_m", math.inf, r"must be from 0\.05 to 1000"),
        ("noise_m", 0.11, r"must be from 0 to 0\.1"),
        ("dropout", 1.1, "must be from 0 to 1"),
    ],
)
def test_a_value_out_of_its_bounds_is_refused_by_name_with_what_is_allowed(
    key: str, value: object, why: str
) -> None:
    with pytest.raises(ConfigError, match=rf"sim\.lidars\.1\.{key} = .*: .*{why}"):
        read(lidars(**{key: value}))


@pytest.mark.parametrize(
    ("changed", "why"),
    [
        ({"range_min_m": 5.0, "range_max_m": 5.0}, "range_max_m must be more than range_min_m"),
        ({"name": "front"}, "each lidar needs a name of its own"),
        ({"topic": "scan"}, "each lidar needs a topic of its own"),
        ({"height_m": 0.3}, "there is no such key"),
    ],
)
def test_lidars_that_do_not_fit_together_are_refused(changed: dict[str, object], why: str) -> None:
    with pytest.raises(ConfigError, match=why):
        read(lidars(**changed))


def test_the_first_lidar_is_where_everybody_looks_for_it() -> None:
    document = tomllib.loads(DIAGONAL)
    document["sim"]["lidars"][0]["topic"] = "scan_front"
    with pytest.raises(ConfigError, match='the first lidar\'s topic must be "scan"'):
        read(document)


def test_a_list_and_the_keys_of_the_one_lidar_are_refused_together() -> None:
    document = lidars()
    document["sim"]["lidar_beams"] = 360
    with pytest.raises(ConfigError, match=r"sim\.lidar_beams = 360: give either \[\[sim\.lidars\]\] or this"):
        read(document)


@pytest.mark.parametrize("count", [0, MAX_LIDARS + 1])
def test_a_robot_has_one_to_four_lidars(count: int) -> None:
    some = [{"name": f"l{n}", "topic": f"scan{n or ''}"} for n in range(count)]
    with pytest.raises(ConfigError, match=r"at (least|most)"):
        read({"sim": {"lidars": some}})
