"""The window's texts and errors; tests/system/test_viewer.py tests the window itself."""

import pytest

from sim.overlay import Mode, Shown
from sim.plant import Plant
from sim.viewer import NoDisplayError, open_viewer, words


def test_the_window_says_mode_speed_and_what_is_nearest() -> None:
    assert words(Shown(Mode.LIMITED, (), 0.416, 0.4449)) == (
        "mode\nspeed\nnearest",
        "LIMITED\n0.42 m/s\n0.44 m",
    )


def test_a_robot_that_stands_says_why_in_words() -> None:
    left, right = words(Shown(Mode.STOPPED, ("OBSTACLE",), 0.0, 0.30))
    assert left.split("\n")[1] == "why"
    assert right.split("\n")[1] == "obstacle too close"


def test_a_robot_whose_causes_are_over_says_that_it_waits_for_neutral() -> None:
    both = ("SCAN_STALE", "OVERRUN")
    _, right = words(Shown(Mode.STOPPED, both, over=("OVERRUN",)))
    assert right.split("\n")[1] == "no fresh scan"
    _, right = words(Shown(Mode.STOPPED, both, over=both))
    assert right.split("\n")[1] == "over, waits for neutral: no fresh scan, the supervisor was late"


def test_without_a_supervisor_it_says_so() -> None:
    assert words(Shown())[1] == "NO SUPERVISOR\n0.00 m/s\n-"


def test_without_a_display_there_is_no_window(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(NoDisplayError, match="there is no display"):
        open_viewer(Plant("empty"))
