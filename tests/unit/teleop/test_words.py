"""The mode in words."""

import math
from dataclasses import replace

import pytest

from teleop.pilots.pilot import NEUTRAL
from teleop.screen.display import LATE_S, SILENT_AFTER_S, News, news, next_step
from teleop.screen.view import Control, Tone, View
from tests.unit.teleop.views import REASONS, driving, over, source, status, stopped
from wire.messages import SafetyStatus
from wire.reasons import LIMIT_WORDS, Limit, StopReason


def said(newest: SafetyStatus, **fields: object) -> News:
    return news(driving(newest, **fields))


CAUSES = {
    "ESTOP": "the emergency stop is latched",
    "ESTOP_STATION_LOST": "a required e-stop station is missing, or was lost",
    "ESTOP_UNRECORDED": "an emergency stop could not be recorded on disk",
    "BASE_RUNAWAY": "the base moves although zero is commanded",
    "OVERRUN": "the supervisor was late, or its machine was suspended",
    "SENSOR_CONFLICT": "two programs publish on one sensor's key",
    "SENSOR_MISMATCH": "the scans contradict the measured motion",
    "BASE_UNRESPONSIVE": "the base does not follow its commands",
    "ODOM_STALE": "odometry was lost",
    "SCAN_INVALID": "the lidar's scan proves nothing: all NaN",
    "SCAN_STALE": "the newest scan is 0.4 s old",
    "SOURCE_LOST": "the connection to teleop was lost",
    "COMMAND_INVALID": "teleop sent an invalid command",
    "COMMAND_STALE": "the commands of teleop arrive too late or out of order",
    "COMMAND_TIMEOUT": "teleop was silent for too long",
    "NO_COMMAND": "no source commands the robot",
    "SCAN_BLIND": "the motion would enter unseen space",
    "OBSTACLE": "too close for this motion: 0.28 m at 46 deg left",
}
STEPS = {
    "ESTOP": "press s, then r to reset",
    "ESTOP_STATION_LOST": "start it, press s, then r if still stopped",
    "ESTOP_UNRECORDED": "free or repair the state directory, press s",
    "BASE_RUNAWAY": "cut the robot's power",
    "OVERRUN": "press s to re-arm",
    "SENSOR_CONFLICT": "stop one of the two programs, press s",
    "SENSOR_MISMATCH": "correct yaw_rad, flip or odometry, and restart",
    "BASE_UNRESPONSIVE": "check the base and its e-stop, press s",
    "ODOM_STALE": "wait for odometry, press s",
    "SCAN_INVALID": "check the lidar, press s",
    "SCAN_STALE": "check the lidar, press s",
    "SOURCE_LOST": "press s to re-arm",
    "COMMAND_INVALID": "press s to re-arm",
    "COMMAND_STALE": "press s to re-arm",
    "COMMAND_TIMEOUT": "press s to re-arm",
    "NO_COMMAND": "press s to arm",
    "SCAN_BLIND": "press s, or drive where the lidar sees",
    "OBSTACLE": "press s, or drive away from it",
}


@pytest.mark.parametrize("reason", REASONS)
def test_every_stop_reason_has_a_sentence_and_a_next_step(reason: str) -> None:
    newest = stopped(reason, scan_problem="all NaN", scan_age_s=0.4, nearest_m=0.28, nearest_bearing_rad=0.8)
    assert said(newest) == News("STOPPED", CAUSES[reason], STEPS[reason], Tone.STOP, (reason,))


def test_no_two_stop_reasons_sound_the_same() -> None:
    assert len({said(stopped(reason)).what for reason in REASONS}) == len(REASONS)


def test_a_stop_for_the_disk_shows_what_the_record_lacks() -> None:
    what = said(
        stopped("ESTOP_UNRECORDED", estop_record_problem="a pressed e-stop could not be recorded: full")
    )
    assert what.what == "a pressed e-stop could not be recorded: full"


def test_an_estop_that_is_not_on_disk_says_so_in_ascii() -> None:
    what = said(stopped("ESTOP", estop_record_problem="the disk is full\x1b[2J"))
    assert what.what == f"{CAUSES['ESTOP']}; the disk is full?[2J"


def test_a_latched_estop_says_who_pressed_it_beside_the_problem_of_its_record() -> None:
    by = "pressed by joy, 2026-11-26 14:20:05"
    assert said(stopped("ESTOP", causes=["ESTOP"], detail=by)).what == f"{CAUSES['ESTOP']}: {by}"
    newest = stopped("ESTOP", causes=["ESTOP"], detail=by, estop_record_problem="the disk is full")
    assert said(newest).what == f"{CAUSES['ESTOP']}: {by}; the disk is full"


def test_a_stop_reason_that_is_new_is_shown_by_its_name() -> None:
    what = said(stopped("FLOOD\x1b[2J"))
    assert what.what == "unknown stop reason FLOOD?[2J"
    assert what.next_step == "remove the cause, press s"
    assert what.reasons == ("FLOOD?[2J",)


def test_a_stop_without_a_reason_says_so() -> None:
    assert said(stopped()) == News(
        "STOPPED", "the supervisor gives no reason", "press s to re-arm", Tone.STOP
    )


def test_the_first_reason_is_explained_and_all_are_named() -> None:
    what = said(stopped("ESTOP", "OBSTACLE"))
    assert what.what == CAUSES["ESTOP"]
    assert what.reasons == ("ESTOP", "OBSTACLE")


OVER = {
    "ESTOP": "the emergency stop was pressed, and has been reset",
    "ESTOP_STATION_LOST": "a required e-stop station was missing",
    "ESTOP_UNRECORDED": "an emergency stop could not have been recorded on disk",
    "BASE_RUNAWAY": "the base moved although zero was commanded",
    "OVERRUN": "the supervisor was late",
    "SENSOR_CONFLICT": "two programs published on one sensor's key",
    "SENSOR_MISMATCH": "the scans contradicted the measured motion",
    "BASE_UNRESPONSIVE": "the base did not follow its commands",
    "ODOM_STALE": "there was no odometry",
    "SCAN_INVALID": "the lidar's scans proved nothing",
    "SCAN_STALE": "there was no fresh scan",
    "SOURCE_LOST": "the connection to a command source was lost",
    "COMMAND_INVALID": "a command was invalid",
    "COMMAND_STALE": "commands arrived too late or out of order",
    "COMMAND_TIMEOUT": "commands were missing for too long",
    "NO_COMMAND": "no source commanded the robot",
    "SCAN_BLIND": "the motion would have entered unseen space",
    "OBSTACLE": "something was too close",
}


def test_the_tests_know_every_stop_reason_of_the_law() -> None:
    assert list(CAUSES) == [reason.value for reason in StopReason]


@pytest.mark.parametrize("reason", REASONS)
def test_a_stop_whose_causes_are_over_says_what_it_was_and_asks_for_neutral_alone(reason: str) -> None:
    what = said(over(reason, "COMMAND_TIMEOUT"))
    assert what == News(
        "STOPPED",
        f"{OVER[reason]}. Over now",
        "press s to drive again",
        Tone.STOP,
        (),
        (reason, "COMMAND_TIMEOUT"),
    )


def test_a_cause_that_holds_comes_before_a_worse_one_that_is_over() -> None:
    what = said(over("OVERRUN", causes=("SCAN_STALE",), scan_age_s=0.4))
    assert (what.what, what.next_step) == (CAUSES["SCAN_STALE"], STEPS["SCAN_STALE"])
    assert (what.reasons, what.over) == (("SCAN_STALE",), ("OVERRUN",))


def test_an_unknown_reason_that_is_over_is_named_in_ascii() -> None:
    assert said(over("FLOOD\x1b[2J")).what == "the reason was FLOOD?[2J. Over now"


def test_who_only_looks_on_is_shown_that_the_operator_must_re_arm() -> None:
    assert said(over("OVERRUN"), control=Control.VIEW_ONLY).next_step == "the operator must re-arm"


def test_neutral_after_a_stop_is_reached_as_the_control_says() -> None:
    step = said(over("OVERRUN"), control=Control.HOLD).next_step
    assert step == "let go of the keys to drive again"


@pytest.mark.parametrize(
    ("detail", "what"),
    [
        ("unseen space at 40° left", "unseen space at 40 deg left"),
        ("two writers on scan: a1b2…, c3d4…", "two writers on scan: a1b2.., c3d4.."),
        ("\x1b[2J", "?[2J"),
    ],
)
def test_what_the_law_knows_of_a_cause_is_said_in_ascii_instead_of_the_general_sentence(
    detail: str, what: str
) -> None:
    assert said(over(causes=("SCAN_BLIND",), detail=detail)).what == what


def test_an_invalid_scan_is_explained_by_the_law_or_by_its_problem() -> None:
    newest = over(causes=("SCAN_INVALID",), detail="rear: all NaN", scan_problem="frozen")
    assert said(newest).what == "the lidar's scan proves nothing: rear: all NaN"
    assert said(replace(newest, detail="")).what == "the lidar's scan proves nothing: frozen"


def test_a_robot_that_is_slowed_says_by_what_if_the_law_knows() -> None:
    newest = status(SafetyStatus.LIMITED, scale=0.4, causes=["SCAN_BLIND"], detail="unseen space ahead")
    assert said(newest).what == "slowed to 40%: unseen space ahead"
    assert said(replace(newest, causes=[])).what == "slowed to 40%"


@pytest.mark.parametrize("limit", LIMIT_WORDS)
def test_each_limit_says_why_and_what_to_do(limit: Limit) -> None:
    words = LIMIT_WORDS[limit]
    newest = status(SafetyStatus.LIMITED, scale=0.6, causes=[limit], detail="3 of 5", nearest_m=1.0)
    what = f"slowed to 60%: {words.now.replace('WHO', 'teleop')}"
    assert said(newest) == News("LIMITED", what, words.step, Tone.CAUTION)


def test_a_robot_that_is_held_without_a_stop_says_so() -> None:
    newest = status(
        SafetyStatus.LIMITED, scale=0.0, causes=["OBSTACLE"], nearest_m=0.2, nearest_bearing_rad=0.0
    )
    assert said(newest).what == "held at zero: 0.20 m ahead"


def test_an_alarm_comes_first() -> None:
    what = said(stopped("BASE_RUNAWAY", alarm=True))
    assert what.what == "ALARM: the base moves although zero is commanded"


@pytest.mark.parametrize(
    ("age_s", "what"),
    [(LATE_S, "was silent for too long"), (0.2, "silent for 0.2 s"), (math.nan, "was silent for too long")],
)
def test_a_silence_that_lasts_is_counted(age_s: float, what: str) -> None:
    newest = stopped("COMMAND_TIMEOUT", owner="joy", sources=[source("teleop"), source("joy", age_s=age_s)])
    assert said(newest).what == f"joy {what}"


def test_the_one_at_fault_is_a_source_where_nobody_owns_the_wheels() -> None:
    assert said(stopped("COMMAND_TIMEOUT", owner="")).what == "a source was silent for too long"
    assert said(stopped("SOURCE_LOST", owner="")).what == "the connection to a source was lost"


def test_a_cause_without_its_number_is_still_a_sentence() -> None:
    assert said(stopped("SCAN_STALE")).what == "there is no fresh scan"
    assert said(stopped("SCAN_INVALID")).what.endswith("proves nothing: no usable beams")
    assert said(stopped("OBSTACLE")).what == "too close for this motion"
    assert said(stopped("OBSTACLE", nearest_m=0.3)).what.endswith("motion: 0.30 m")


def test_an_emergency_stop_asks_for_neutral_only_where_it_is_missing() -> None:
    assert said(stopped("ESTOP"), wanted=NEUTRAL, sent=NEUTRAL).next_step == "press r to reset"
    assert said(stopped("ESTOP"), wanted=NEUTRAL).next_step == "press s, then r to reset"


def test_neutral_is_reached_as_the_control_says() -> None:
    view = driving(control=Control.HOLD)
    assert next_step(view, "COMMAND_TIMEOUT") == "let go of the keys to re-arm"


@pytest.mark.parametrize("reason", REASONS)
def test_who_only_looks_on_is_never_told_to_press_a_key_that_drives(reason: str) -> None:
    step = said(stopped(reason), control=Control.VIEW_ONLY).next_step
    assert "press" not in step
    assert step


def test_before_the_first_status_it_says_for_whom_it_waits() -> None:
    what = news(View("teleop", "tcp/127.0.0.1:7447\x07"))
    assert what.mode == "WAITING"
    assert what.what == "nothing heard from the supervisor at tcp/127.0.0.1:7447?"
    assert what.tone is Tone.CAUTION


def test_a_status_holds_until_the_supervisor_is_silent_for_too_long() -> None:
    assert said(status(), status_age_s=SILENT_AFTER_S).mode == "READY"
    what = said(status(), status_age_s=math.nextafter(SILENT_AFTER_S, 1.0))
    assert what.mode == "NO SUPERVISOR"
    assert what.what == "silent for 0.5 s: it or the link is lost; the base brakes by itself"
    assert what.tone is Tone.STOP


def test_a_status_of_unknown_age_does_not_hold() -> None:
    assert said(status(), status_age_s=math.nan).tone is Tone.STOP


def test_ready_is_armed_for_this_source() -> None:
    assert said(status()) == News("READY", "at rest, armed", "the next command moves the robot", Tone.GOOD)
    assert said(status(sources=[])).tone is Tone.GOOD


def test_ready_for_another_source_is_not_ready_for_this_one() -> None:
    newest = status(owner="joy", sources=[source("joy"), source("teleop", armed=False)])
    assert said(newest) == News("READY", "for joy, but not for teleop", "press s to arm", Tone.CAUTION)
    assert said(replace(newest, owner="")).what == "for another source, but not for teleop"


def test_a_source_that_the_supervisor_does_not_know_is_shown_this() -> None:
    what = said(status(sources=[source("joy")], unknown_sources=["teleop"]))
    assert what.what == "but the supervisor ignores teleop"
    assert what.next_step == "add it to the sources in robot.toml"


def test_driving_as_requested() -> None:
    assert said(status(SafetyStatus.DRIVING)) == News(
        "DRIVING", "as requested", "SPACE is the emergency stop", Tone.GOOD
    )


def test_another_source_that_drives_is_named_and_whether_it_can_be_relieved() -> None:
    newest = status(SafetyStatus.DRIVING, owner="joy")
    assert said(newest).what == "joy drives, not you"
    assert said(newest).next_step.startswith("command motion to take over")
    above = status(SafetyStatus.DRIVING, owner="boss", sources=[source("teleop"), source("boss", 200)])
    assert said(above).next_step.startswith("it must stop first")
    unheard = status(SafetyStatus.DRIVING, owner="joy", sources=[])
    assert said(unheard).next_step.startswith("it must stop first")


def test_limited_says_to_what_and_by_what() -> None:
    newest = status(SafetyStatus.LIMITED, scale=0.4, nearest_m=0.62, nearest_bearing_rad=-math.pi / 2)
    assert said(newest) == News(
        "LIMITED",
        "slowed to 40%: 0.62 m at 90 deg right",
        "steer away from it, or slow down",
        Tone.CAUTION,
    )
    assert (
        said(replace(newest, owner="joy")).what
        == "joy drives, not you; slowed to 40%: 0.62 m at 90 deg right"
    )


def test_who_only_looks_on_is_shown_who_drives() -> None:
    newest = status(SafetyStatus.DRIVING)
    assert said(newest, control=Control.VIEW_ONLY) == News("DRIVING", "teleop drives", "", Tone.GOOD)
    assert said(status(sources=[]), control=Control.VIEW_ONLY).what == "at rest, armed"


def test_an_unknown_mode_is_no_permission() -> None:
    assert said(status(77)).tone is Tone.STOP


MODES = [SafetyStatus.READY, SafetyStatus.DRIVING, SafetyStatus.LIMITED]


@pytest.mark.parametrize("mode", MODES)
def test_a_robot_that_answers_too_late_is_not_shown_as_one_that_obeys(mode: int) -> None:
    late = said(status(mode), lateness="the robot answers late")
    assert (late.mode, late.what, late.tone) == ("LATE", "the robot answers late", Tone.STOP)
    assert late.next_step == "no motion is sent: wait, or use a faster link"


def test_a_stop_is_shown_instead_of_a_late_answer() -> None:
    assert said(stopped("ESTOP"), lateness="the robot answers late").mode == "STOPPED"
