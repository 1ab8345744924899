"""`lifeline up --detach`: what it says of the robot that runs in the background."""

from dataclasses import replace
from pathlib import Path

import pytest

from deploy.keys.commands import init, issue
from deploy.keys.register import Request
from deploy.stack.launch import Launch
from deploy.stack.statedir import StateDir
from deploy.up import hints
from wire.host.installation import ENVIRONMENT
from wire.roles import Role


@pytest.fixture
def keys(tmp_path: Path) -> Path:
    """Bundles of a robot's computer: supervisor and base."""
    directory = tmp_path / "keys"
    init(directory, replace=False)
    for role in (Role.SUPERVISOR, Role.BASE):
        bundle_of(directory, role)
    return directory


def bundle_of(keys: Path, role: Role) -> Path:
    return Path(issue(keys, Request(f"my_{role}", role, None, None), 3600.0)["bundle"]).parent


def said(state: Path, bundles: Path | None = None) -> str:
    endpoint = "tcp/127.0.0.1:7447" if bundles is None else "quic/127.0.0.1:7447"
    return "\n".join(hints(StateDir(state), Launch.read(None, endpoint, bundles)))


def test_only_a_state_directory_that_is_not_the_default_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    state = tmp_path / "a b"
    text = said(state)
    assert f"`lifeline status --state-dir '{state}'`" in text
    assert f"`lifeline down --state-dir '{state}'`" in text
    monkeypatch.setenv(ENVIRONMENT, str(state))
    assert "`lifeline status`, stop it with `lifeline down`" in said(state)


def test_teleop_is_named_only_if_it_has_a_bundle_of_the_role_operator(tmp_path: Path, keys: Path) -> None:
    assert "drive with `lifeline teleop`" in said(tmp_path)
    bundles = bundle_of(keys, Role.BASE)
    text = said(tmp_path, bundles)
    assert "drive with `" not in text
    assert "`lifeline keys issue NAME --role operator --robot robot`" in text
    assert "drive with `" not in said(tmp_path, bundles / "my_base")
    bundle_of(keys, Role.OPERATOR)
    assert "drive with `" in said(tmp_path, bundles)


def test_a_page_that_drives_is_named_instead_of_teleop(tmp_path: Path) -> None:
    launch = replace(Launch.read(None, None), drives_on_page=True)
    text = "\n".join(hints(StateDir(tmp_path), launch))
    assert "drive on the page; `lifeline station --new-code" in text
    assert "teleop" not in text


def test_the_address_for_other_programs_is_named_in_plain_words(tmp_path: Path) -> None:
    assert "your own Zenoh programs connect to unixsock-stream/" in said(tmp_path)


def test_teleop_of_another_robot_than_the_default_is_named_with_its_options() -> None:
    drive = Launch.read(None, "tcp/127.0.0.1:7448").drive
    assert drive.startswith("lifeline teleop --config ")
    assert drive.endswith("--endpoint tcp/127.0.0.1:7448")
