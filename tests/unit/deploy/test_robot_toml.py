"""deploy/robot.toml contains every key with its default."""

import re
import tomllib
from typing import Any

import pytest
from pydantic import BaseModel

from deploy.stack.launch import DEFAULT_CONFIG
from ros2.config import Ros2Section, RosSourceSection
from sim.config import SimSection
from supervisor.config import SupervisorSection
from supervisor.measured import MeasuredLidar, MeasuredSection
from teleop.pilots.config import TeleopSection
from wire.host.config import SECTIONS, BusSection, Section, read_toml, section

MODELS: dict[str, type[Section]] = {
    "bus": BusSection,
    "supervisor": SupervisorSection,
    "teleop": TeleopSection,
    "sim": SimSection,
}


def _keys(values: BaseModel) -> dict[str, Any]:
    """Return the values as in a file: TOML has no null, so unset values are omitted."""
    return values.model_dump(mode="json", exclude_none=True)


def test_there_is_a_model_for_every_section() -> None:
    assert (*MODELS, "ros2", "measured") == SECTIONS


def test_the_example_names_every_key_of_measured_in_comments_because_it_describes_no_measured_robot() -> None:
    text = DEFAULT_CONFIG.read_text()
    assert "measured" not in tomllib.loads(text)
    lines = text[text.index("# [measured]") :].splitlines()
    document = tomllib.loads("\n".join(line[2:] for line in lines if re.match(r"# (\[|\w+ = )", line)))
    measured = document["measured"]
    assert MeasuredSection.model_validate(measured)
    assert measured.keys() == MeasuredSection.model_fields.keys()
    assert measured["lidars"]["front"].keys() == MeasuredLidar.model_fields.keys()


@pytest.mark.parametrize("name", MODELS)
def test_the_example_names_every_key_with_its_default(name: str) -> None:
    document = tomllib.loads(DEFAULT_CONFIG.read_text())
    assert document[name] == _keys(MODELS[name]())


@pytest.mark.parametrize("name", MODELS)
def test_the_example_is_what_the_defaults_are(name: str) -> None:
    assert section(read_toml(DEFAULT_CONFIG), name, MODELS[name]) == MODELS[name]()


def test_the_example_names_every_key_of_ros_2_in_comments_because_the_section_itself_changes_what_starts() -> (
    None
):
    text = DEFAULT_CONFIG.read_text()
    assert "ros2" not in tomllib.loads(text)
    lines = text[text.index("# [ros2]") :].splitlines()
    document = tomllib.loads("\n".join(line[2:] for line in lines if re.match(r"# (\[|\w+ = )", line)))
    (source,) = document["ros2"].pop("sources")
    python, stamp = document["ros2"].pop("python"), document["ros2"].pop("stamp")
    assert Ros2Section(stamped=True, stamp=stamp).stamp == "base"
    assert {**document["ros2"], "sources": []} == _keys(Ros2Section())
    assert python.endswith(".ros2/bin/python")
    assert source.keys() == RosSourceSection.model_fields.keys()
    defaults = {name: field.default for name, field in RosSourceSection.model_fields.items()}
    assert all(source[name] == defaults[name] for name in ("stamped", "clock", "clock_limit_s", "arm"))
    assert Ros2Section.model_validate({**document["ros2"], "sources": [source]})
