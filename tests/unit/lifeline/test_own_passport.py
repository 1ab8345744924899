"""The passport that a station's page shows: signed, and of the configuration in use."""

import hashlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from deploy.stack.errors import DeployError
from deploy.stack.launch import ANY_BASE, Launch
from lifeline.own_passport import sentence_of
from tests.unit.passport.test_reading import PASSPORT, bundle, page_of
from wire.bundle import AUTHORITY


@pytest.fixture
def keys(tmp_path: Path) -> Path:
    return bundle(tmp_path / "keys")


@pytest.fixture
def launch(tmp_path: Path) -> Launch:
    file = tmp_path / "robot.toml"
    file.write_text("")
    return Launch.read(file, "tcp/127.0.0.1:20001")


def passport_of(config: Path, keys: Path | None) -> Path:
    """Write the passport of a robot's configuration."""
    configuration_sha256 = hashlib.sha256(config.read_bytes()).hexdigest()
    record = config.with_name("passport.json")
    record.write_text(PASSPORT.model_copy(update={"configuration_sha256": configuration_sha256}).to_json())
    return page_of(record, keys)


def test_a_verified_passport_of_this_configuration_gives_its_sentence(launch: Launch, keys: Path) -> None:
    file = passport_of(launch.config, keys)
    for robot, authority in ((launch, keys / AUTHORITY), (launch.with_keys(keys), None)):
        assert sentence_of(robot, file, authority).startswith("After the one fault tested")


def unsigned(launch: Launch, keys: Path) -> str:
    return sentence_of(launch, passport_of(launch.config, None), keys)


def changed(launch: Launch, keys: Path) -> str:
    file = passport_of(launch.config, keys)
    file.write_text(file.read_text().replace("0.3", "0.2"))
    return sentence_of(launch, file, keys)


def of_another_authority(launch: Launch, keys: Path) -> str:
    return sentence_of(launch, passport_of(launch.config, keys), bundle(keys.with_name("others")))


def of_an_older_configuration(launch: Launch, keys: Path) -> str:
    file = passport_of(launch.config, keys)
    launch.config.write_text("[supervisor]\nmax_linear_m_s = 0.9\n")
    return sentence_of(launch, file, keys)


def of_a_removed_configuration(launch: Launch, keys: Path) -> str:
    file = passport_of(launch.config, keys)
    launch.config.unlink()
    return sentence_of(launch, file, keys)


def without_an_authority(launch: Launch, keys: Path) -> str:
    return sentence_of(launch, passport_of(launch.config, keys), None)


def of_an_unknown_robot(launch: Launch, keys: Path) -> str:
    return sentence_of(
        replace(launch, nodes=("supervisor", ANY_BASE)), passport_of(launch.config, keys), keys
    )


def no_passport(launch: Launch, keys: Path) -> str:
    return sentence_of(launch, launch.config, keys)


@pytest.mark.parametrize(
    ("show", "sentence"),
    [
        (unsigned, "is not signed"),
        (changed, "has text that was not signed"),
        (of_another_authority, "authority"),
        (
            of_an_older_configuration,
            "was measured with another configuration than .*robot.toml: measure this robot again",
        ),
        (of_a_removed_configuration, "cannot read .*robot.toml"),
        (without_an_authority, "name its certificate with --authority"),
        (of_an_unknown_robot, "name it with --config"),
        (no_passport, "robot.toml: "),
    ],
)
def test_any_other_passport_is_refused(
    show: Callable[[Launch, Path], str], sentence: str, launch: Launch, keys: Path
) -> None:
    with pytest.raises(DeployError, match=sentence):
        show(launch, keys)
