"""The environment in which the viewer, and the policy with which its page, connect to no other host."""

import json
from pathlib import Path

import pytest

from deploy.stack.errors import DeployError
from lifeline.view.window import check_display, policy, silent


def test_the_viewers_own_configuration_disables_analytics(tmp_path: Path) -> None:
    environment = silent(tmp_path)
    settings = json.loads((Path(environment["XDG_CONFIG_HOME"]) / "rerun" / "analytics.json").read_text())
    assert settings["analytics_enabled"] is False
    assert Path(settings["data_dir_path"]).is_relative_to(tmp_path)


@pytest.mark.parametrize("name", ["HTTPS_PROXY", "https_proxy", "HTTP_PROXY", "http_proxy", "ALL_PROXY"])
def test_every_request_goes_to_a_proxy_that_does_not_exist(tmp_path: Path, name: str) -> None:
    assert silent(tmp_path)[name] == "http://127.0.0.1:9"


def test_without_a_display_the_other_ways_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(DeployError, match="use --web and a browser, or --out"):
        check_display()
    monkeypatch.setenv("WAYLAND_DISPLAY", "wayland-0")
    check_display()


def test_the_page_may_connect_to_its_data_and_nowhere_else() -> None:
    rules = dict(rule.split(" ", 1) for rule in policy(9091).split("; "))
    assert rules["connect-src"] == "'self' http://127.0.0.1:9091 http://localhost:9091"
    assert rules["default-src"] == "'none'"
    hosts = [place for rule in rules.values() for place in rule.split() if "//" in place]
    assert hosts == ["http://127.0.0.1:9091", "http://localhost:9091"]
