"""`[ros2]` of robot.toml: each refusal names the key and what to do."""

import math

import pytest

from ros2.config import MAX_TOPIC, Ros2Section, SupervisorValues, fit_to_lidars
from supervisor.config import SupervisorSection
from wire.host.config import ConfigError, Section, read_sections, section


def ros2(**values: object) -> Ros2Section:
    return section({"ros2": values}, "ros2", Ros2Section)


def refusal(**values: object) -> str:
    with pytest.raises(ConfigError) as caught:
        ros2(**values)
    return str(caught.value)


def source(name: str = "teleop", topic: str = "teleop/cmd_vel", **values: object) -> dict[str, object]:
    return {"name": name, "topic": topic, **values}


def test_every_key_has_a_default() -> None:
    config = ros2()
    assert (config.scans, config.odom, config.cmd_vel) == (("scan",), "odom", "cmd_vel")
    assert (config.stamped, config.discovery_range, config.sources) == (False, "localhost", ())


def test_a_relative_topic_is_in_the_namespace_and_an_absolute_one_is_not() -> None:
    assert ros2().resolved("scan") == "/scan"
    assert ros2(namespace="robot1").resolved("scan") == "/robot1/scan"
    assert ros2(namespace="/fleet/robot1").resolved("front/scan") == "/fleet/robot1/front/scan"
    assert ros2(namespace="robot1").resolved("/scan") == "/scan"


@pytest.mark.parametrize("key", ["scan", "odom", "cmd_vel"])
@pytest.mark.parametrize(
    "topic", ["", "/", "scan/", "a//b", "1scan", "a b", "~/scan", "scan\n", "scän", "a-b", 7]
)
def test_what_is_no_topic_is_refused(key: str, topic: object) -> None:
    assert f"ros2.{key}" in refusal(**{key: topic})


def test_a_topic_has_a_maximum_length() -> None:
    assert ros2(odom="o" * MAX_TOPIC).odom == "o" * MAX_TOPIC
    assert f"at most {MAX_TOPIC} characters" in refusal(odom="o" * (MAX_TOPIC + 1))


@pytest.mark.parametrize("namespace", ["/", "robot1/", "a b"])
def test_what_is_no_namespace_is_refused(namespace: str) -> None:
    assert "ros2.namespace" in refusal(namespace=namespace)


@pytest.mark.parametrize(
    ("key", "low", "high"), [("command_timeout_s", 0.02, 1.0), ("domain_id", 0, 232)], ids=str
)
def test_a_number_has_bounds(key: str, low: float, high: float) -> None:
    step = 1 if isinstance(low, int) else 1e-9
    assert getattr(ros2(**{key: low}), key) == low
    assert getattr(ros2(**{key: high}), key) == high
    for value in (low - step, high + step):
        assert f"ros2.{key}" in refusal(**{key: value})


@pytest.mark.parametrize(
    "hold_s", [math.nextafter(0.05, 0.0), math.nextafter(1.0, 2.0), 0.0, math.nan, math.inf]
)
def test_a_hold_is_neither_off_nor_endless(hold_s: float) -> None:
    message = refusal(sources=[source(hold_s=hold_s)])
    assert "ros2.sources.0.hold_s" in message
    assert "the robot drives on for this long" in message


def test_a_hold_at_its_bounds_is_accepted_and_without_it_nothing_is_held() -> None:
    for hold_s in (0.05, 1.0):
        assert ros2(sources=[source(hold_s=hold_s)]).sources[0].hold_s == hold_s
    assert ros2(sources=[source()]).sources[0].hold_s is None


@pytest.mark.parametrize(
    ("values", "key"),
    [
        ({"sources": [source(arm="always")]}, "ros2.sources.0.arm"),
        ({"sources": [source(name="no/slash")]}, "ros2.sources.0.name"),
        ({"sources": [source(holds=0.5)]}, "ros2.sources.0.holds"),
        ({"sources": [source(f"s{n}", f"t{n}") for n in range(9)]}, "ros2.sources"),
        ({"discovery_range": "internet"}, "ros2.discovery_range"),
        ({"frame_id": ""}, "ros2.frame_id"),
        ({"frame_id": "f" * 65}, "ros2.frame_id"),
        ({"python": ""}, "ros2.python"),
        ({"scan": []}, "ros2.scan"),
        ({"scan": ["a", "b", "c", "d", "e"]}, "ros2.scan"),
        ({"scans": "scan"}, "ros2.scans"),
    ],
)
def test_a_wrong_value_or_key_is_named(values: dict[str, object], key: str) -> None:
    assert key in refusal(**values)


def test_two_sources_need_two_names() -> None:
    message = refusal(sources=[source(), source(topic="other")])
    assert "ros2.sources.1.name" in message
    assert "each source needs a name of its own" in message


def test_two_sources_need_two_topics_however_they_are_written() -> None:
    message = refusal(namespace="r", sources=[source(), source("joy", "/r/teleop/cmd_vel")])
    assert "ros2.sources.1.topic" in message
    assert "is already the topic of the source teleop" in message
    assert "/joy/cmd_vel" in message


def test_a_source_on_the_topic_of_the_base_is_refused() -> None:
    message = refusal(sources=[source(topic="/cmd_vel")])
    assert "ros2.sources.0.topic" in message
    assert "is already the topic of cmd_vel: remap the program" in message


def test_a_topic_has_one_type_of_message() -> None:
    for values, holder in (
        ({"odom": "cmd_vel"}, "cmd_vel"),
        ({"scan": "odom"}, "odom"),
        ({"scan": ["front", "/estop"]}, "the e-stop"),
        ({"sources": [source(topic="/lifeline/reset")]}, "Lifeline's reset"),
    ):
        assert f"is already the topic of {holder}" in refusal(**values)


def test_two_lidars_need_two_topics() -> None:
    assert ros2(scan=["front", "rear"]).scans == ("front", "rear")
    message = refusal(scan=["front", "front"])
    assert "ros2.scan.1" in message
    assert "each lidar needs a topic of its own" in message


@pytest.mark.parametrize("value", ["base", "zero", "now"])
def test_the_stamp_of_commands_needs_a_type_that_has_one(value: str) -> None:
    assert ros2(stamped=True, stamp=value).stamp == value
    assert "ros2.stamp" in (message := refusal(stamp=value))
    assert "needs stamped = true" in message
    assert ros2(stamped=True).stamp is None
    assert "ros2.stamp" in refusal(stamped=True, stamp="off")


def test_the_clock_of_a_source_needs_a_type_with_a_stamp() -> None:
    assert ros2(sources=[source(stamped=True, clock="own")]).sources[0].clock == "own"
    assert ros2(sources=[source(stamped=True)]).sources[0].clock_limit_s == 1.0
    for key, message in (
        ("clock", refusal(sources=[source(clock="own")])),
        ("clock_limit_s", refusal(sources=[source(clock_limit_s=0.5)])),
    ):
        assert f"ros2.sources.0.{key}" in message
        assert "needs stamped = true" in message


@pytest.mark.parametrize(
    "limit_s", [0.0, math.nextafter(0.05, 0.0), math.nextafter(10.0, 11.0), math.inf, math.nan]
)
def test_a_clock_limit_outside_its_range_is_refused(limit_s: float) -> None:
    assert "ros2.sources.0.clock_limit_s" in refusal(sources=[source(stamped=True, clock_limit_s=limit_s)])


# --- the values of [supervisor] that the ROS 2 process reads


def read(document: dict[str, object]) -> SupervisorValues:
    models: dict[str, type[Section]] = {"ros2": Ros2Section, "supervisor": SupervisorValues}
    return read_sections(document, models, fit_to_lidars)[SupervisorValues]


def lidar(name: str, topic: str) -> dict[str, object]:
    return {"name": name, "topic": topic, "x_m": 0.0}


def test_the_defaults_are_those_of_the_supervisor() -> None:
    values = read({})
    assert values.command_timeout_s == SupervisorSection().command_timeout_s
    assert values.lidar_topics == tuple(lidar.topic for lidar in SupervisorSection().all_lidars())


def test_other_keys_of_the_supervisor_are_ignored() -> None:
    values = read({"supervisor": {"command_timeout_s": 0.3, "stop_distance_m": 0.5}})
    assert values.command_timeout_s == 0.3


def test_each_lidar_has_a_topic_of_ros_in_the_same_order() -> None:
    two = {"lidars": [lidar("front", "scan"), lidar("rear", "scan_rear")]}
    assert read({"supervisor": two, "ros2": {"scan": ["a", "b"]}}).lidar_topics == ("scan", "scan_rear")
    for scan in ("a", ["a", "b", "c"]):
        with pytest.raises(ConfigError, match=r"ros2\.scan.*one topic for each of the 2 lidars"):
            read({"supervisor": two, "ros2": {"scan": scan}})


def test_lidars_are_not_compared_if_a_section_is_wrong() -> None:
    with pytest.raises(ConfigError) as caught:
        read({"ros2": {"scan": ["a", "b"], "domain_id": -1}})
    assert "lidars" not in str(caught.value)
