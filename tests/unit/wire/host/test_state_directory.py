"""Where the state directory is: the same place, wherever a process is started."""

from pathlib import Path

import pytest

from wire.host import installation as module
from wire.host.config import ConfigError
from wire.host.installation import ENVIRONMENT, checkout, state_directory


@pytest.fixture(autouse=True)
def _elsewhere(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv(ENVIRONMENT, raising=False)
    monkeypatch.delenv("XDG_STATE_HOME", raising=False)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    (tmp_path / "working").mkdir()
    monkeypatch.chdir(tmp_path / "working")


@pytest.fixture
def _installed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(module, "__file__", str(tmp_path / "site-packages" / "wire" / "state_directory.py"))


def test_in_a_checkout_it_is_the_checkouts() -> None:
    root = checkout()
    assert root is not None
    assert (root / "pyproject.toml").is_file()
    assert state_directory() == root / ".lifeline"


@pytest.mark.usefixtures("_installed")
def test_an_installation_has_one_for_each_user(tmp_path: Path) -> None:
    assert state_directory() == tmp_path / "home" / ".local" / "state" / "lifeline"


@pytest.mark.usefixtures("_installed")
def test_the_users_directory_for_state_may_be_elsewhere(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    assert state_directory() == tmp_path / "state" / "lifeline"


@pytest.mark.usefixtures("_installed")
@pytest.mark.parametrize("home", ["", "state"])
def test_a_relative_directory_for_state_counts_as_none(
    home: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", home)
    assert state_directory() == tmp_path / "home" / ".local" / "state" / "lifeline"


def test_the_environments_goes_before_all_others(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(ENVIRONMENT, "/run/robot")
    assert state_directory() == Path("/run/robot")
    monkeypatch.setenv(ENVIRONMENT, "~/robot")
    assert state_directory() == Path("~/robot").expanduser()


def test_the_home_of_nobody_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(ENVIRONMENT, "~no-such-user/state")
    with pytest.raises(ConfigError, match="there is no user ~no-such-user"):
        state_directory()
