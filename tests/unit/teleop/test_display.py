"""The one line."""

import math
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from teleop.pilots.pilot import NEUTRAL, Velocity
from teleop.pilots.vigilance import DEMAND_S
from teleop.screen.display import SILENT_AFTER_S, news, next_step, render
from teleop.screen.view import Control, Tone, View
from tests.unit.teleop.views import REASONS, text
from wire.messages import SafetyStatus, header, planar_twist

FORWARD = Velocity(0.1, 0.2)


def status(mode: int = SafetyStatus.READY, **fields: Any) -> SafetyStatus:  # noqa: ANN401 - any field of the status
    return SafetyStatus(header("base_link", 0), mode=mode, **fields)


def view(newest: SafetyStatus | None, *, wanted: Velocity = FORWARD, age_s: float = 0.0) -> View:
    return View("teleop", "tcp/127.0.0.1:7447", wanted=wanted, sent=wanted, status=newest, status_age_s=age_s)


def shown(
    newest: SafetyStatus | None, *, wanted: Velocity = FORWARD, age_s: float = 0.0, width: int = 79
) -> str:
    return text(render(view(newest, wanted=wanted, age_s=age_s), width))


def tones(newest: SafetyStatus | None, *, age_s: float = 0.0) -> set[Tone]:
    return {segment.tone for segment in render(view(newest, age_s=age_s), 79)} - {Tone.PLAIN}


def test_without_a_status_it_says_for_whom_it_waits() -> None:
    assert "waiting for the supervisor at tcp/127.0.0.1:7447" in shown(None)


def test_what_is_asked_for_stands_first() -> None:
    assert shown(None).startswith("v +0.10 m/s ω +0.20 rad/s | ")


def test_zero_has_no_sign() -> None:
    assert shown(None, wanted=NEUTRAL).startswith("v  0.00 m/s ω  0.00 rad/s | ")


def test_a_status_holds_until_the_supervisor_is_silent_for_too_long() -> None:
    assert "READY" in shown(status(), age_s=SILENT_AFTER_S)


def test_a_silent_supervisor_is_shown_instead_of_its_last_words() -> None:
    line = shown(status(nearest_m=0.4), age_s=math.nextafter(SILENT_AFTER_S, 1.0))
    assert "supervisor: silent for 0.5 s" in line
    assert "READY" not in line
    assert "0.40 m" not in line


def test_driving_shows_what_is_permitted() -> None:
    assert "DRIVING v +0.10 ω +0.20" in shown(status(SafetyStatus.DRIVING, permitted=planar_twist(0.1, 0.2)))


def test_limited_shows_to_what() -> None:
    assert "LIMITED to v +0.05 ω -0.10" in shown(
        status(SafetyStatus.LIMITED, permitted=planar_twist(0.05, -0.1))
    )


@pytest.mark.parametrize("reason", [*REASONS, "SOMETHING_NEW"])
def test_every_stop_reason_fits_80_columns_together_with_its_hint(reason: str) -> None:
    line = shown(status(SafetyStatus.STOPPED, reasons=[reason], nearest_m=0.25, warning=True))
    assert f"STOPPED: {reason} - {next_step(view(None), reason)}" in line


def test_a_stop_names_all_its_reasons_and_a_hint_for_the_first() -> None:
    line = shown(status(SafetyStatus.STOPPED, reasons=["OBSTACLE", "ESTOP"]), width=120)
    assert "STOPPED: OBSTACLE, ESTOP - press s, or drive away from it" in line


def test_where_not_all_reasons_fit_the_others_are_counted() -> None:
    line = shown(status(SafetyStatus.STOPPED, reasons=["ESTOP", "SCAN_STALE", "COMMAND_TIMEOUT"]))
    assert "STOPPED: ESTOP +2 - press s, then r to reset" in line


def test_a_stop_without_a_reason_is_still_a_stop() -> None:
    assert "STOPPED - press s" in shown(status(SafetyStatus.STOPPED))


OVERS = ["OVERRUN", "SCAN_STALE"]


def test_a_stop_whose_causes_are_over_says_that_neutral_is_all_that_is_missing() -> None:
    newest = status(SafetyStatus.STOPPED, reasons=OVERS, latched=OVERS)
    assert "STOPPED: was OVERRUN, SCAN_STALE; over now - press s to drive again" in shown(newest, width=120)


@pytest.mark.parametrize("reason", REASONS)
def test_a_stop_whose_causes_are_over_fits_80_columns_beside_what_is_asked_for(reason: str) -> None:
    line = shown(status(SafetyStatus.STOPPED, reasons=[reason] * 3, latched=[reason] * 3, nearest_m=0.4))
    assert line == f"v +0.10 m/s ω +0.20 rad/s | STOPPED: was {reason} +2 - press s"


def test_causes_that_hold_come_first_and_what_is_over_is_marked() -> None:
    newest = status(SafetyStatus.STOPPED, reasons=OVERS, causes=["SCAN_STALE"], latched=["OVERRUN"])
    assert "STOPPED: SCAN_STALE, OVERRUN (over) - check the lidar, press s" in shown(newest, width=120)
    assert "STOPPED: SCAN_STALE +1 - check the lidar, press s" in shown(newest)


def test_who_only_looks_on_is_shown_who_can_drive_again() -> None:
    newest = status(SafetyStatus.STOPPED, reasons=OVERS, latched=OVERS)
    looking_on = View("view", "", control=Control.VIEW_ONLY, status=newest)
    for width in (120, 79):
        line = text(render(looking_on, width))
        assert "the operator must re-arm" in line
        assert "press" not in line


def test_an_alarm_is_said() -> None:
    assert "ALARM" in shown(status(SafetyStatus.STOPPED, reasons=["BASE_RUNAWAY"], alarm=True))


def test_another_source_that_drives_is_named() -> None:
    assert "(joy drives)" in shown(status(SafetyStatus.DRIVING, owner="joy"))
    assert "drives" not in shown(status(SafetyStatus.DRIVING, owner="teleop"))


@pytest.mark.parametrize(
    ("bearing_rad", "where"),
    [
        (0.0, "ahead"),
        (1.5, "at 86° left"),
        (-2.3, "at 132° right"),
        (3.1, "behind"),
    ],
)
def test_the_nearest_obstacle_is_shown_with_its_direction(bearing_rad: float, where: str) -> None:
    assert f"0.45 m {where}" in shown(status(nearest_m=0.45, nearest_bearing_rad=bearing_rad))


@pytest.mark.parametrize("nearest_m", [math.nan, math.inf])
def test_an_obstacle_that_is_not_known_is_not_shown(nearest_m: float) -> None:
    assert shown(status(nearest_m=nearest_m)).endswith("READY")


def test_a_warning_is_marked() -> None:
    assert "! 0.45 m" in shown(status(nearest_m=0.45, warning=True))
    assert "!" not in shown(status(nearest_m=0.45, warning=False))


@pytest.mark.parametrize(
    ("mode", "tone"),
    [
        (SafetyStatus.READY, Tone.GOOD),
        (SafetyStatus.DRIVING, Tone.GOOD),
        (SafetyStatus.LIMITED, Tone.CAUTION),
        (SafetyStatus.STOPPED, Tone.STOP),
        (77, Tone.STOP),
    ],
)
def test_each_mode_has_its_tone(mode: int, tone: Tone) -> None:
    assert tones(status(mode)) == {tone}


def test_a_silent_supervisor_has_the_tone_of_a_stop() -> None:
    assert tones(status(), age_s=1.0) == {Tone.STOP}


def test_the_nearest_obstacle_gives_way_where_the_line_is_one_column_too_long() -> None:
    newest = status(nearest_m=0.45)
    whole = shown(newest)
    assert shown(newest, width=len(whole)) == whole
    assert shown(newest, width=len(whole) - 1).endswith("READY")


def test_a_narrow_terminal_keeps_the_stop_and_its_reason() -> None:
    assert shown(status(SafetyStatus.STOPPED, reasons=["OBSTACLE"]), width=20) == "STOPPED: OBSTACLE -…"


def test_control_sequences_from_the_network_do_not_reach_the_terminal() -> None:
    line = shown(status(SafetyStatus.STOPPED, reasons=["\x1b[2J\r\n漢"], owner="\x07"), width=200)
    assert "STOPPED: ?[2J???" in line
    assert line.replace("ω", "w").isascii()
    assert line.isprintable()


def test_a_bearing_that_is_not_known_is_left_out() -> None:
    assert shown(status(nearest_m=0.45, nearest_bearing_rad=math.nan)).endswith("| 0.45 m")


def test_without_unicode_the_line_is_ascii() -> None:
    newest = status(nearest_m=0.45, nearest_bearing_rad=1.5)
    assert text(render(view(newest), 79, unicode=False)).endswith("0.45 m at 86 deg left")
    newest = status(SafetyStatus.LIMITED, permitted=planar_twist(0.05, -0.1))
    assert text(render(view(newest), 79, unicode=False)).endswith("LIMITED to v +0.05 w -0.10")
    assert text(render(view(newest), 10, unicode=False)) == "LIMITED t."


def test_who_only_looks_on_is_shown_who_can_act() -> None:
    looking_on = View("view", "", control=Control.VIEW_ONLY, status=status(0, reasons=["OBSTACLE"]))
    assert "STOPPED: OBSTACLE - the operator must re-arm" in text(render(looking_on, 100))


@settings(deadline=None)
@given(
    st.integers(0, 255),
    st.lists(st.text(max_size=40), max_size=5),
    st.text(max_size=20),
    st.floats(),
    st.floats(),
    st.floats(0.0, 1.0),
    st.integers(1, 200),
)
def test_whatever_the_status_says_the_line_fits(
    mode: int, reasons: list[str], owner: str, number: float, bearing_rad: float, age_s: float, width: int
) -> None:
    newest = status(
        mode,
        reasons=reasons,
        owner=owner,
        permitted=planar_twist(number, number),
        nearest_m=number,
        nearest_bearing_rad=bearing_rad,
        warning=True,
        alarm=True,
    )
    assert len(shown(newest, age_s=age_s, width=width)) <= width


def test_a_late_answer_is_shown_instead_of_any_mode_but_a_stop() -> None:
    late = replace(
        view(status(SafetyStatus.DRIVING)), lateness="the robot answers after 0.70 s, and the limit is 0.5 s"
    )
    assert text(render(late, 79)) == "LATE: the robot answers after 0.70 s, and the limit is 0.5 s"
    stop = replace(late, status=status(SafetyStatus.STOPPED, reasons=["ESTOP"]))
    assert "STOPPED: ESTOP" in text(render(stop, 79))


@pytest.mark.parametrize(
    ("left_s", "seconds"), [(DEMAND_S, 3), (2.0, 2), (math.nextafter(2.0, 3.0), 3), (0.1, 1), (-1.0, 0)]
)
def test_a_demand_for_a_key_counts_down_instead_of_the_mode(left_s: float, seconds: int) -> None:
    asking = replace(view(status(SafetyStatus.DRIVING)), vigilance_left_s=left_s)
    assert f"PRESS ENTER: zero in {seconds} s" in text(render(asking, 79))
    assert news(asking).mode == "PRESS ENTER"
    assert news(asking).what.endswith(f"zero is sent in {seconds} s")


def test_before_the_end_of_vigilance_no_key_is_demanded_and_a_stop_is_shown_first() -> None:
    attentive = replace(
        view(status(SafetyStatus.DRIVING)), vigilance_left_s=math.nextafter(DEMAND_S, math.inf)
    )
    assert "PRESS" not in text(render(attentive, 79))
    assert news(attentive).mode == "DRIVING"
    stop = status(SafetyStatus.STOPPED, reasons=["ESTOP"])
    assert news(replace(view(stop), vigilance_left_s=0.5)).mode == "STOPPED"
