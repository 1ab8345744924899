"""The error if a package of an extra is missing."""

import sys

import pytest

from wire.host import installation
from wire.host.installation import EXTRAS, how_to_install, missing_extra, require


@pytest.mark.parametrize(
    ("module", "extra"),
    [
        ("mujoco", "sim"),
        ("mujoco.egl", "sim"),
        ("PIL", "sim"),
        ("av", "video"),
        ("numpy", None),
        (None, None),
    ],
)
def test_a_module_that_was_not_found_names_its_extra(module: str | None, extra: str | None) -> None:
    assert missing_extra(ModuleNotFoundError(name=module)) == extra


def test_an_extra_counts_as_missing_as_soon_as_one_of_its_modules_does(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    require("sim")
    monkeypatch.setitem(sys.modules, "PIL", None)  # how Python marks what cannot be imported
    with pytest.raises(ModuleNotFoundError) as raised:
        require("sim")
    assert missing_extra(raised.value) == "sim"


def test_the_command_that_installs_an_extra_keeps_those_that_are_installed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for modules in EXTRAS.values():
        for module in modules:
            monkeypatch.setitem(sys.modules, module, None)
    assert how_to_install("sim") == "install lifeline[sim], with `make setup`"
    monkeypatch.setattr(installation, "checkout", lambda: None)
    assert "'.[sim]'" in how_to_install("sim")
    monkeypatch.delitem(sys.modules, "evdev")
    assert "'.[gamepad,sim]'" in how_to_install("sim")
