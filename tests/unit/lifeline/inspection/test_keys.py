"""Names of topics as users write them, and Zenoh's key expressions."""

from pathlib import Path

import pytest
import zenoh
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from lifeline.cli.app import app
from lifeline.inspection.keys import by_full_key, full_key, is_key, matches, topic_of
from supervisor.config import NamedLidarSection, SupervisorSection
from wire.messages import LaserScan, Twist


@pytest.mark.parametrize(
    "name", ["cmd_vel", "/robot/cmd_vel", "robot/cmd_vel", " cmd_vel ", "/robot/cmd_vel/"]
)
def test_all_spellings_of_a_topic_are_one_key(name: str) -> None:
    assert full_key(name, "robot") == "robot/cmd_vel"


def test_a_leading_slash_makes_a_name_absolute() -> None:
    assert full_key("/other/scan", "robot") == "other/scan"
    assert full_key("other/scan", "robot") == "robot/other/scan"


@pytest.mark.parametrize(
    "key", ["", "a//b", "robot/**", "robot/*", "a b", "robot/$*vel", "a/\x1b", "x" * 256, "@/**"]
)
def test_wildcards_and_control_characters_are_not_keys(key: str) -> None:
    assert not is_key(key)


def test_the_commands_of_any_source_and_the_scans_of_configured_lidars_have_types() -> None:
    lidars = tuple(NamedLidarSection(name=topic, topic=topic) for topic in ("scan", "scan_rear"))
    known = by_full_key("robot", SupervisorSection(lidars=lidars))
    for key, wanted in (
        ("robot/teleop/cmd_vel", Twist),
        ("robot/stranger/cmd_vel", Twist),
        ("robot/scan_rear", LaserScan),
    ):
        topic = topic_of(key, "robot", known)
        assert topic is not None
        assert topic.type is wanted
    for key in ("robot/scan_left", "other/teleop/cmd_vel", "robot"):
        assert topic_of(key, "robot", known) is None
    assert list(known).count("robot/scan") == 1


@pytest.mark.parametrize(
    ("name", "code", "output"),
    [
        ("/robot/scan", 0, "sensor_msgs/msg/LaserScan\n"),
        ("camera", 2, "the type of robot/camera is unknown"),
        ("a b", 2, "'a b' is not a key"),
    ],
)
def test_the_type_of_a_topic_is_known_without_a_running_robot(
    tmp_path: Path, name: str, code: int, output: str
) -> None:
    result = CliRunner().invoke(app, ["topic", "type", name, "--state-dir", str(tmp_path)])
    assert (result.exit_code, output in result.output) == (code, True), result.output


PARTS = st.lists(st.sampled_from(["a", "b", "ab", "*", "**", "a$*", "$*b"]), min_size=1, max_size=4)


@given(PARTS, st.lists(st.sampled_from(["a", "b", "ab", "abb"]), min_size=1, max_size=4))
def test_an_expression_matches_the_keys_that_it_matches_for_zenoh(
    expression: list[str], key: list[str]
) -> None:
    try:
        theirs = zenoh.KeyExpr.autocanonize("/".join(expression))
    except zenoh.ZError:
        return
    assert matches(str(theirs), "/".join(key)) == theirs.intersects(zenoh.KeyExpr("/".join(key)))


@pytest.mark.timeout(5)
@pytest.mark.parametrize(
    ("expression", "key"),
    [("**/a/" * 60 + "b", "/".join("a" * 120)), ("a$*" * 60 + "b", "a" * 240)],
    ids=["parts", "one part"],
)
def test_a_hostile_expression_takes_no_exponential_time(expression: str, key: str) -> None:
    assert not matches(expression, key)


def test_wildcards_do_not_match_the_admin_space() -> None:
    assert not matches("**", "@/hub")
    assert matches("**/scan", "scan")
