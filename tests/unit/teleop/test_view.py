"""The parts of a View."""

from teleop.pilots.pilot import NEUTRAL, Velocity
from teleop.screen.view import Segment, Tone, View, columns_of, plain
from tests.unit.teleop.views import source, status


def test_plain_leaves_printable_ascii_alone_and_everything_else_one_column_wide() -> None:
    assert plain("wall-1 [~]") == "wall-1 [~]"
    assert plain("\x1b[2J\n漢\u202e\x7f\x9b") == "?[2J?????"


def test_a_line_is_as_wide_as_its_segments() -> None:
    assert columns_of((Segment("ab"), Segment("", Tone.DIM), Segment("c"))) == 3


def test_the_own_source_is_found_by_its_name() -> None:
    own = source("teleop")
    assert View("teleop", "", status=status(sources=[source("joy"), own])).own is own
    assert View("path", "", status=status(sources=[own])).own is None
    assert View("teleop", "").own is None


def test_neutral_is_nothing_asked_for_now_and_at_the_end_of_the_ramp() -> None:
    moving = Velocity(0.0, 0.1)
    assert View("teleop", "").is_neutral
    assert not View("teleop", "", wanted=moving, sent=NEUTRAL).is_neutral
    assert not View("teleop", "", wanted=NEUTRAL, sent=moving).is_neutral
