"""deploy/robot.toml contains every key with its default."""

import tomllib
from typing import Any

import pytest
from pydantic import BaseModel

from deploy.stack.launch import DEFAULT_CONFIG
from sim.config import SimSection
from supervisor.config import SupervisorSection
from teleop.config import TeleopSection
from wire.config import SECTIONS, BusSection, Section, read_toml, section

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
    assert tuple(MODELS) == SECTIONS


@pytest.mark.parametrize("name", SECTIONS)
def test_the_example_names_every_key_with_its_default(name: str) -> None:
    document = tomllib.loads(DEFAULT_CONFIG.read_text())
    assert document[name] == _keys(MODELS[name]())


@pytest.mark.parametrize("name", SECTIONS)
def test_the_example_is_what_the_defaults_are(name: str) -> None:
    assert section(read_toml(DEFAULT_CONFIG), name, MODELS[name]) == MODELS[name]()
