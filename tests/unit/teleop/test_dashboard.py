"""The dashboard that fills the terminal."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from teleop.pilots.pilot import NEUTRAL, Velocity
from teleop.screen.dashboard import MIN_COLUMNS, MIN_ROWS, render_dashboard
from teleop.screen.display import SILENT_AFTER_S
from teleop.screen.view import Control, Event, KeyHelp, Line, Rates, Robot, Tone, View
from tests.unit.teleop.views import (
    REASONS,
    driving,
    odom_of,
    over,
    room,
    scan_of,
    source,
    status,
    stopped,
    text,
)
from wire.messages import SafetyStatus, planar_twist

SIZES = [(80, 24), (100, 30), (160, 50), (200, 24), (80, 60)]


def shown(view: View, columns: int = 80, rows: int = 24, *, unicode: bool = True) -> str:
    return "\n".join(text(line) for line in render_dashboard(view, columns, rows, unicode=unicode))


def row_of(view: View, label: str, columns: int = 80, rows: int = 24) -> str:
    """The row of the panel with this label, from the label on."""
    below_the_head = shown(view, columns, rows).splitlines()[2:]
    (row,) = [row for row in below_the_head if f" {label} " in row]
    return row[row.index(f" {label} ") + 1 :].rstrip()


def tone_of(lines: list[Line], what: str) -> Tone:
    """The tone in which `what` is shown."""
    (tone,) = {segment.tone for line in lines for segment in line if what in segment.text}
    return tone


@pytest.mark.parametrize(("columns", "rows"), SIZES)
def test_it_fills_the_terminal_exactly(columns: int, rows: int) -> None:
    lines = render_dashboard(driving(), columns, rows)
    assert [len(text(line)) for line in lines] == [columns] * rows


# --- the mode


@pytest.mark.parametrize("reason", REASONS)
def test_a_stop_fills_the_first_two_lines_with_its_sentence_and_what_to_do_next(reason: str) -> None:
    first, second, *_ = render_dashboard(driving(stopped(reason)), 80, 24)
    assert text(first).startswith(" STOPPED: ")
    assert text(second).startswith(" > ")
    assert text(second).endswith(f" {reason} ")
    assert [(segment.tone, len(segment.text)) for segment in (*first, *second)] == [
        (Tone.STOP_BANNER, 80)
    ] * 2


@pytest.mark.parametrize("reason", REASONS)
def test_every_sentence_fits_80_columns_together_with_a_collision_warning(reason: str) -> None:
    newest = stopped(
        reason, alarm=reason == "BASE_RUNAWAY", nearest_m=0.28, nearest_bearing_rad=-2.3, scan_age_s=0.3
    )
    (sentence,) = (line.rstrip() for line in shown(driving(newest), 300, 24).splitlines()[:1])
    assert shown(driving(newest)).splitlines()[0].rstrip() == sentence
    if reason == "OBSTACLE":
        assert shown(driving(replace(newest, warning=True))).splitlines()[0].endswith(" COLLISION WARNING ")


def test_a_warning_that_does_not_fit_beside_the_sentence_is_left_to_the_panel() -> None:
    lines = shown(driving(stopped("OVERRUN", nearest_m=0.4, warning=True))).splitlines()
    assert "COLLISION" not in lines[0]
    assert any(" WARNING " in line for line in lines[3:])


def test_a_silence_is_reported_as_a_person_would() -> None:
    newest = stopped("COMMAND_TIMEOUT", sources=[source("teleop", age_s=0.21)])
    first, second, *_ = shown(driving(newest)).splitlines()
    assert first.rstrip() == " STOPPED: teleop silent for 0.2 s"
    assert second.startswith(" > press s to re-arm  ")


def test_what_is_over_stands_after_what_holds() -> None:
    first, second, *_ = shown(driving(over("OVERRUN", causes=("SCAN_STALE",), scan_age_s=0.4))).splitlines()
    assert first.rstrip() == " STOPPED: the newest scan is 0.4 s old"
    assert second.startswith(" > check the lidar, press s ")
    assert second.endswith(" SCAN_STALE (over: OVERRUN) ")


@pytest.mark.parametrize("reason", REASONS)
def test_a_stop_that_is_over_asks_for_one_key_and_fits_80_columns(reason: str) -> None:
    first, second, *_ = render_dashboard(driving(over(reason)), 80, 24)
    assert text(first).startswith(" STOPPED: ")
    assert text(first).rstrip().endswith(". Over now")
    assert text(second).startswith(" > press s to drive again ")
    assert text(second).endswith(f" (over: {reason}) ")
    assert {segment.tone for segment in (*first, *second)} == {Tone.STOP_BANNER}


def test_more_reasons_than_fit_are_cut_off_after_the_first() -> None:
    second = shown(driving(stopped(*REASONS))).splitlines()[1]
    assert " ESTOP ESTOP_STATION_LOST ESTOP_UNRECORDED" in second
    assert second.endswith(".. ")
    long = stopped(*(["A" * 60] * 3))
    assert shown(driving(long)).splitlines()[1].endswith("A.. ")


def test_an_alarm_is_the_first_thing_that_is_read() -> None:
    newest = stopped("BASE_RUNAWAY", alarm=True)
    first, second, *_ = shown(driving(newest)).splitlines()
    assert first.startswith(" STOPPED: ALARM: the base moves")
    assert "cut the robot's power" in second


@pytest.mark.parametrize(
    ("newest", "word", "tone"),
    [
        (status(SafetyStatus.READY), " READY ", Tone.GOOD_BANNER),
        (status(SafetyStatus.DRIVING), " DRIVING ", Tone.GOOD_BANNER),
        (status(SafetyStatus.LIMITED), " LIMITED ", Tone.CAUTION_BANNER),
    ],
)
def test_every_other_mode_is_a_word_in_its_tone(newest: SafetyStatus, word: str, tone: Tone) -> None:
    first = render_dashboard(driving(newest), 80, 24)[0][0]
    assert (first.text, first.tone) == (word, tone)


def test_only_a_stop_fills_the_line() -> None:
    for mode in (SafetyStatus.READY, SafetyStatus.DRIVING, SafetyStatus.LIMITED):
        lines = render_dashboard(driving(status(mode)), 80, 24)
        assert not any(s.tone is Tone.STOP_BANNER for line in lines[:2] for s in line)


def test_another_source_that_drives_is_named() -> None:
    assert " DRIVING  joy drives, not you" in shown(driving(status(SafetyStatus.DRIVING, owner="joy")))


def test_sources_that_the_supervisor_refuses_are_named() -> None:
    newest = status(unknown_sources=["rogue\x1b"])
    assert "refused, unknown: rogue?" in shown(driving(newest))
    assert "rogue" not in shown(driving(newest, status_age_s=3.0))


def test_the_title_shows_how_soon_the_robot_answers_while_that_is_known() -> None:
    assert ", answers in 0.03 s" in shown(driving(status(), round_trip_s=0.034))
    for fields in ({"round_trip_s": math.inf}, {}, {"round_trip_s": 0.1, "status_age_s": 3.0}):
        assert "answers in" not in shown(driving(status(), **fields))


# --- old data is shown as old


def test_without_a_status_nothing_is_claimed() -> None:
    screen = shown(View("teleop", "tcp/127.0.0.1:7447"))
    assert " WAITING  nothing heard from the supervisor at tcp/127.0.0.1:7447" in screen
    for label in ("nearest", "permitted", "measured"):
        assert row_of(View("teleop", ""), label).endswith("not known")
    assert "no odometry yet" in screen
    assert "no scan yet" in screen


def test_a_silent_supervisor_is_a_stop_and_its_last_words_are_grey_with_their_age() -> None:
    newest = status(SafetyStatus.DRIVING, nearest_m=0.42, warning=True, permitted=planar_twist(0.11, 0.0))
    lines = render_dashboard(driving(newest, status_age_s=3.2), 80, 24)
    assert "NO SUPERVISOR: silent for 3.2 s" in text(lines[0])
    assert tone_of(lines, "0.42 m") is Tone.DIM
    assert tone_of(lines, "3.2 s ago") is Tone.DIM
    assert tone_of(lines, "+0.11") is Tone.DIM
    assert not any("WARNING" in text(line) for line in lines)


def test_old_odometry_is_grey_with_its_age() -> None:
    lines = render_dashboard(driving(odom_age_s=math.nextafter(SILENT_AFTER_S, 1.0)), 80, 24)
    assert tone_of(lines, "0.5 s ago") is Tone.DIM
    assert tone_of(lines, "+0.29") is Tone.DIM
    assert not any("heading" in text(line) for line in lines)
    fresh = render_dashboard(driving(odom_age_s=SILENT_AFTER_S), 80, 24)
    assert tone_of(fresh, "+0.29") is Tone.STRONG


def test_an_old_scan_is_grey_with_its_age() -> None:
    lines = render_dashboard(driving(scan=room(0.6, 1.0, 1.0, 1.0), scan_age_s=12.34), 80, 24)
    picture = [segment.tone for line in lines[3:17] for segment in line[:-6] if "⠀" < segment.text[:1] <= "⣿"]
    assert "the scan is 12.3 s old" in shown(driving(scan_age_s=12.34))
    assert Tone.STOP not in picture
    assert Tone.CAUTION not in picture


# --- the nearest object


@pytest.mark.parametrize(
    ("nearest_m", "warning", "distance_tone", "chip"),
    [
        (0.80, False, Tone.STRONG, None),
        (0.49, True, Tone.CAUTION, (" WARNING ", Tone.CAUTION_BANNER)),
        (0.30, True, Tone.STOP, (" TOO NEAR", Tone.STOP_BANNER)),
    ],
)
def test_the_nearest_obstacle_is_shown_with_distance_bearing_and_a_word_where_it_is_close(
    nearest_m: float,
    *,
    warning: bool,
    distance_tone: Tone,
    chip: tuple[str, Tone] | None,
) -> None:
    newest = status(nearest_m=nearest_m, nearest_bearing_rad=0.7, warning=warning)
    lines = render_dashboard(driving(newest), 80, 24)
    assert tone_of(lines, f"{nearest_m:.2f} m") is distance_tone
    assert row_of(driving(newest), "nearest") == f"nearest   {nearest_m:.2f} m  ↖ at 40° left"
    chips = [(s.text, s.tone) for line in lines[3:] for s in line if s.text in (" WARNING ", " TOO NEAR")]
    assert chips == ([] if chip is None else [chip])


@pytest.mark.parametrize("mode", [SafetyStatus.STOPPED, SafetyStatus.READY, SafetyStatus.LIMITED])
def test_a_collision_warning_stands_in_the_head_whatever_the_mode(mode: int) -> None:
    head = shown(driving(status(mode, nearest_m=0.4, warning=True))).splitlines()[:2]
    assert any(line.endswith(" COLLISION WARNING ") for line in head)
    head = shown(driving(status(mode, nearest_m=0.6, warning=False))).splitlines()[:2]
    assert not any("WARNING" in line for line in head)


@pytest.mark.parametrize(
    ("nearest_m", "what"), [(math.nan, "not known"), (math.inf, "nothing in sight"), (5000.0, "far")]
)
def test_an_obstacle_that_is_not_there_has_no_distance(nearest_m: float, what: str) -> None:
    assert row_of(driving(status(nearest_m=nearest_m)), "nearest") == f"nearest   {what}"


@pytest.mark.parametrize("nearest_m", [0.0, 0.2, 0.5, 1.0, 1.99, 2.0, 7.0])
def test_the_gauge_is_as_long_as_there_is_room(nearest_m: float) -> None:
    rows = shown(driving(status(nearest_m=nearest_m))).splitlines()
    (gauge,) = [
        row.partition("┃")[0][-10:] + "┃" + row.partition("┃")[2] for row in rows if row.endswith(" 2 m")
    ]
    cells = 30
    filled = sum(gauge.count(char) for char in "━┃") - 2 * (nearest_m < 0.3) - (0.3 <= nearest_m < 0.5)
    assert abs(filled - cells * min(1.0, nearest_m / 2.0)) <= 2.5


# --- motion


def test_the_three_velocities_stand_one_below_the_other() -> None:
    view = driving(status(SafetyStatus.LIMITED, permitted=planar_twist(0.3, -0.24)))
    for label, forward, turn in (
        ("requested", "+0.50", "-0.40"),
        ("permitted", "+0.30", "-0.24"),
        ("measured", "+0.29", "-0.23"),
    ):
        row = row_of(view, label)
        assert row.startswith(f"{label:<10} {forward} ")
        assert f"  {turn} " in row


def bars(view: View, label: str) -> tuple[str, str]:
    """Forward and turn."""
    forward, turn = (part for part in row_of(view, label).split() if "┼" in part)
    return forward, turn


@pytest.mark.parametrize(
    ("sent", "forward", "turn"),
    [
        (Velocity(0.0, 0.0), "────┼────", "────┼────"),
        (Velocity(1.0, 2.0), "────┼━━━━", "━━━━┼────"),
        (Velocity(-0.5, -1.0), "──━━┼────", "────┼━━──"),
        (Velocity(0.6, 0.7), "────┼━━╾─", "──╼━┼────"),
        (Velocity(0.005, -0.005), "────┼╾───", "────┼╾───"),
        (Velocity(-0.0049, 0.0049), "────┼────", "────┼────"),
        (Velocity(9.0, -9.0), "────┼━━━━", "────┼━━━━"),
        (Velocity(math.nan, math.inf), "────┼────", "━━━━┼────"),
    ],
)
def test_bars_go_right_for_forward_and_to_the_side_of_the_turn(
    sent: Velocity, forward: str, turn: str
) -> None:
    assert bars(driving(sent=sent), "requested") == (forward, turn)


def test_the_number_is_what_is_wanted_and_the_bar_what_is_sent_on_the_way_there() -> None:
    view = driving(wanted=Velocity(1.0, 0.0), sent=NEUTRAL)
    assert row_of(view, "requested").startswith("requested  +1.00 ────┼────")


def test_who_only_looks_on_sees_what_is_asked_for_by_who_drives() -> None:
    newest = status(SafetyStatus.DRIVING, owner="joy", commanded=planar_twist(0.7, 0.1))
    looking = driving(newest, control=Control.VIEW_ONLY, wanted=NEUTRAL, sent=NEUTRAL)
    assert row_of(looking, "requested").startswith("requested  +0.70")
    assert row_of(View("view", "", control=Control.VIEW_ONLY), "requested").endswith("not known")


def test_the_position_is_that_of_the_odometry() -> None:
    assert row_of(driving(), "position") == "position   +1.25,  -0.50 m  heading +90°"


@pytest.mark.parametrize(
    ("value", "text_"),
    [(99.5, "+99.50"), (123.4, "  +123"), (-1e9, "-large"), (math.nan, "     -"), (1e300, "+large")],
)
def test_a_number_never_needs_more_than_six_characters(value: float, text_: str) -> None:
    odom = odom_of(value, 0.0, math.nan, 0.0, 0.0)
    assert row_of(driving(odom=odom), "position") == f"position  {text_},   0.00 m  heading -°"


# --- control, link, events, keys


def test_the_control_and_its_note_and_level_are_shown() -> None:
    screen = shown(driving(control=Control.HOLD, control_note="key releases reported", level=4))
    assert "control   hold   speed ■■■■□ 4 of 5" in screen
    assert " key releases reported" in screen
    assert "speed" not in shown(driving(control=Control.VIEW_ONLY, keys=()))


def test_a_speed_level_is_not_shown_before_it_is_known() -> None:
    assert "control   incremental   " in shown(driving())
    assert "of 5" not in shown(driving(level=None))


def test_the_link_shows_rate_and_age_of_each_stream_and_of_the_own_commands() -> None:
    view = driving(
        status(sources=[source("teleop", age_s=0.13)]), rates=Rates(10.2, 49.7, math.nan), odom_age_s=0.3
    )
    assert row_of(view, "link").split() == ["link", "status", "odom", "scan", "commands"]
    assert row_of(view, "rate").split() == ["rate", "10", "Hz", "50", "Hz", "-"]
    assert row_of(view, "age") == "age     <0.1 s  0.3 s   <0.1 s  0.1 s"


def test_a_stream_that_is_silent_is_seen_in_the_link() -> None:
    lines = render_dashboard(driving(scan_age_s=250.0, odom=None), 80, 24)
    assert tone_of(lines, "250 s   ") is Tone.STOP
    assert tone_of(lines, "none    ") is Tone.CAUTION
    assert row_of(driving(scan_age_s=1e9), "age").split()[-3] == "long"


def test_the_newest_events_are_shown_and_more_of_them_where_there_is_room() -> None:
    events = tuple(Event(f"12:00:{second:02}", f"event {second}") for second in range(20))
    small, large = shown(driving(events=events)), shown(driving(events=events), 160, 50)
    assert "12:00:19 event 19" in small
    assert "event 18" in small
    assert "event 17" not in small
    assert all(f"event {second}" in large for second in range(20))
    assert large.index("event 19") < large.index("event 3")


def test_a_long_event_goes_on_in_the_next_line() -> None:
    events = (
        Event("12:00:00", "reset refused: joy is not neutral, let go of its stick first and reset again"),
    )
    large = shown(driving(events=events), 160, 50)
    first, second = (row[-58:] for row in large.splitlines() if "refused" in row or "reset again" in row)
    assert first.startswith(" 12:00:00 reset refused: joy")
    assert second.startswith(" " * 10)


def test_every_key_is_explained() -> None:
    screen = shown(driving())
    for key in driving().keys:
        assert f"{key.keys} " in screen
        assert key.does in screen


def test_a_key_of_two_columns_does_not_move_what_follows() -> None:
    assert "漢" not in shown(driving(keys=(KeyHelp("漢", "e\u0301"),)))


def test_keys_that_do_not_fit_are_cut_off_but_never_left_out() -> None:
    keys = tuple(KeyHelp(f"key{number}", "does something that takes long to say") for number in range(12))
    screen = shown(driving(keys=keys))
    assert all(f"key{number} " in screen for number in range(12))
    assert len(shown(driving(keys=keys * 3)).splitlines()) == 24


def test_the_longest_keys_give_way_first() -> None:
    keys = (*(KeyHelp(f"k{number}", "short") for number in range(9)), KeyHelp("long", "goes on and on " * 9))
    screen = shown(driving(keys=keys))
    assert screen.count("short") == 9
    assert "long goes on and on" in screen


# --- messages from the network


def test_nothing_from_the_network_speaks_to_the_terminal() -> None:
    evil = "\x1b[2J\r\n\x07漢\u202e"
    newest = stopped(
        evil,
        owner=evil,
        scan_problem=evil,
        unknown_sources=[evil],
        sources=[source(evil)],
    )
    view = driving(
        newest, events=(Event(evil, evil),), control_note="\x1b\n", keys=(KeyHelp("\x1b", "\x07"),)
    )
    for line in shown(replace(view, source=evil, endpoint=evil)).splitlines():
        assert line.isprintable()
        assert "漢" not in line


NUMBER = st.floats()
AGE = st.one_of(st.floats(0.0, 2.0), st.floats())
TEXT = st.text(max_size=30)
TWIST = st.builds(planar_twist, NUMBER, NUMBER)
STATUSES = st.builds(
    status,
    st.integers(0, 255),
    reasons=st.lists(st.one_of(st.sampled_from(REASONS), TEXT), max_size=4),
    warning=st.booleans(),
    alarm=st.booleans(),
    owner=st.one_of(st.sampled_from(["", "teleop", "joy"]), TEXT),
    commanded=TWIST,
    permitted=TWIST,
    scale=NUMBER,
    nearest_m=NUMBER,
    nearest_bearing_rad=NUMBER,
    scan_age_s=NUMBER,
    scan_problem=TEXT,
    unknown_sources=st.lists(TEXT, max_size=2),
    sources=st.lists(
        st.builds(source, st.sampled_from(["teleop", "joy"]), armed=st.booleans(), age_s=NUMBER), max_size=2
    ),
)
SCANS = st.builds(
    scan_of,
    st.lists(st.floats(width=32), max_size=40).map(lambda ranges: np.array(ranges, dtype=np.float32)),
    NUMBER,
    NUMBER,
    NUMBER,
    NUMBER,
)
VELOCITIES = st.builds(Velocity, NUMBER, NUMBER)
VIEWS = st.builds(
    View,
    TEXT,
    TEXT,
    control=st.sampled_from(Control),
    control_note=TEXT,
    level=st.none() | st.integers(-9, 99),
    wanted=VELOCITIES,
    sent=VELOCITIES,
    most=VELOCITIES,
    status=st.none() | STATUSES,
    status_age_s=AGE,
    odom=st.none() | st.builds(odom_of, NUMBER, NUMBER, NUMBER, NUMBER, NUMBER),
    odom_age_s=AGE,
    scan=st.none() | SCANS,
    scan_age_s=AGE,
    rates=st.builds(Rates, NUMBER, NUMBER, NUMBER),
    robot=st.builds(Robot, NUMBER, stop_distance_m=NUMBER, warning_distance_m=NUMBER),
    events=st.lists(st.builds(Event, TEXT, TEXT, st.sampled_from(Tone)), max_size=4).map(tuple),
    keys=st.lists(st.builds(KeyHelp, TEXT, TEXT), max_size=14).map(tuple),
    help=st.lists(st.builds(KeyHelp, TEXT, TEXT), max_size=25).map(tuple),
    limit=st.none() | VELOCITIES,
)


@settings(deadline=None)
@given(VIEWS, st.integers(-1, 200), st.integers(-1, 60), st.booleans())
def test_whatever_the_view_says_it_fits_and_is_printable(
    view: View,
    columns: int,
    rows: int,
    unicode: bool,  # noqa: FBT001 - drawn by hypothesis
) -> None:
    lines = render_dashboard(view, columns, rows, unicode=unicode)
    assert len(lines) <= max(0, rows)
    for line in lines:
        assert len(text(line)) <= columns
        assert text(line).isprintable()
        assert unicode or text(line).isascii()


# --- terminals with fewer abilities


@pytest.mark.parametrize(
    ("columns", "rows"), [(MIN_COLUMNS - 1, MIN_ROWS), (MIN_COLUMNS, MIN_ROWS - 1), (60, 2)]
)
def test_a_terminal_that_is_too_small_has_the_plain_line_and_says_why(columns: int, rows: int) -> None:
    line, why = shown(driving(), columns, rows).splitlines()
    assert "DRIVING" in line
    assert why == f"terminal {columns}x{rows}: the dashboard needs 80x24"


def test_a_terminal_of_one_row_has_the_plain_line_alone() -> None:
    (line,) = shown(driving(stopped("ESTOP")), 60, 1).splitlines()
    assert "STOPPED: ESTOP" in line


@pytest.mark.parametrize(("columns", "rows"), [(0, 24), (80, 0)])
def test_a_terminal_without_cells_is_shown_nothing(columns: int, rows: int) -> None:
    assert render_dashboard(driving(), columns, rows) == []


@pytest.mark.parametrize(("columns", "rows"), [(80, 24), (160, 50), (50, 10)])
def test_without_unicode_everything_is_ascii_and_still_there(columns: int, rows: int) -> None:
    newest = stopped("OBSTACLE", nearest_m=0.25, nearest_bearing_rad=1.0, warning=True)
    screen = shown(driving(newest, keys=(KeyHelp("↑ ↓", "forward"),)), columns, rows, unicode=False)
    assert screen.isascii()
    assert "STOPPED" in screen
    assert "OBSTACLE" in screen


def test_every_meaning_of_a_colour_is_also_a_word() -> None:
    for newest, words in (
        (stopped("ESTOP"), ["STOPPED", "ESTOP"]),
        (status(SafetyStatus.LIMITED, nearest_m=0.4, warning=True), ["LIMITED", "WARNING"]),
        (status(SafetyStatus.READY, nearest_m=0.2, warning=True), ["READY", "TOO NEAR"]),
    ):
        assert all(word in shown(driving(newest)) for word in words)
