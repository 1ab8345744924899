"""The differ: what it writes makes a terminal show exactly the frame."""

import pyte
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from teleop.screen.output import FrameWriter
from teleop.screen.view import Line, Segment, Tone

COLOURS = {
    Tone.PLAIN: ("default", "default", False, False),
    Tone.DIM: ("brightblack", "default", False, False),
    Tone.STRONG: ("default", "default", True, False),
    Tone.GOOD: ("green", "default", False, False),
    Tone.CAUTION: ("brown", "default", True, False),
    Tone.STOP: ("red", "default", True, False),
    Tone.GOOD_BANNER: ("black", "green", False, False),
    Tone.CAUTION_BANNER: ("black", "brown", False, False),
    Tone.STOP_BANNER: ("brightwhite", "red", True, False),
}
"""Foreground, background, bold, reverse, in pyte's words."""

Cell = tuple[str, tuple[str, str, bool, bool]]


class Terminal:
    """The screen that results from the written bytes."""

    def __init__(self, columns: int, rows: int) -> None:
        self.screen = pyte.HistoryScreen(columns, rows)
        self._stream = pyte.Stream(self.screen)

    def write(self, text: str) -> None:
        self._stream.feed(text)

    def cells(self) -> list[list[Cell]]:
        screen = self.screen
        return [
            [
                (cell.data, (cell.fg, cell.bg, cell.bold, cell.reverse))
                for cell in (screen.buffer[row][column] for column in range(screen.columns))
            ]
            for row in range(screen.lines)
        ]


def expected(lines: list[Line], columns: int, rows: int) -> list[list[Cell]]:
    """The frame as it should look."""
    blank: Cell = (" ", COLOURS[Tone.PLAIN])
    frame: list[list[Cell]] = []
    for row in range(rows):
        line = lines[row] if row < len(lines) else ()
        cells: list[Cell] = [(char, COLOURS[segment.tone]) for segment in line for char in segment.text]
        frame.append((cells + [blank] * columns)[:columns])
    return frame


def line(text: str, tone: Tone = Tone.PLAIN) -> Line:
    return (Segment(text, tone),)


CHARACTERS = st.text("abc xyz━│⣿⠁█▂°ω.0", max_size=12)
LINES = st.lists(
    st.lists(st.builds(Segment, CHARACTERS, st.sampled_from(Tone)), max_size=4).map(tuple), max_size=9
)


@settings(deadline=None)
@given(st.lists(LINES, min_size=1, max_size=5), st.integers(1, 30), st.integers(1, 7))
def test_the_terminal_shows_each_frame_exactly(frames: list[list[Line]], columns: int, rows: int) -> None:
    writer, terminal = FrameWriter(), Terminal(columns, rows)
    for lines in frames:
        terminal.write(writer.frame(lines, columns, rows))
        assert terminal.cells() == expected(lines, columns, rows)
        assert not terminal.screen.history.top  # nothing was scrolled out


@settings(deadline=None)
@given(LINES, LINES, st.integers(1, 30), st.integers(1, 7), st.integers(1, 30), st.integers(1, 7))
def test_after_a_resize_everything_is_drawn_anew(
    before: list[Line], after: list[Line], columns: int, rows: int, new_columns: int, new_rows: int
) -> None:
    writer, terminal = FrameWriter(), Terminal(columns, rows)
    terminal.write(writer.frame(before, columns, rows))
    terminal.screen.resize(new_rows, new_columns)
    terminal.write(writer.frame(after, new_columns, new_rows))
    if (new_columns, new_rows) != (columns, rows):
        assert terminal.cells() == expected(after, new_columns, new_rows)


@settings(deadline=None)
@given(LINES, LINES)
def test_after_forget_whatever_the_terminal_shows_is_replaced(before: list[Line], after: list[Line]) -> None:
    writer, terminal = FrameWriter(), Terminal(20, 5)
    terminal.write(writer.frame(before, 20, 5))
    terminal.write("\x1b[1;1Hsomebody else wrote this here\r\n\x1b[7mand that")
    writer.forget()
    terminal.write(writer.frame(after, 20, 5))
    assert terminal.cells() == expected(after, 20, 5)


def test_a_frame_that_shows_already_costs_nothing() -> None:
    writer = FrameWriter()
    frame = [line("DRIVING", Tone.GOOD), line("0.42 m")]
    assert writer.frame(frame, 40, 5) != ""
    assert writer.frame(frame, 40, 5) == ""


def test_one_changed_character_is_one_written_character() -> None:
    writer = FrameWriter()
    writer.frame([line("v +0.50 m/s")], 80, 24)
    assert "\x1b[1;7H\x1b[0m1\x1b[0m" in writer.frame([line("v +0.51 m/s")], 80, 24)


def test_a_changed_tone_alone_is_written() -> None:
    writer, terminal = FrameWriter(), Terminal(20, 2)
    terminal.write(writer.frame([line("STOPPED", Tone.GOOD)], 20, 2))
    terminal.write(writer.frame([line("STOPPED", Tone.STOP)], 20, 2))
    assert terminal.cells() == expected([line("STOPPED", Tone.STOP)], 20, 2)


def test_two_changes_close_together_are_one_piece() -> None:
    writer = FrameWriter()
    writer.frame([line("0.10 0.20")], 20, 1)
    assert writer.frame([line("0.11 0.21")], 20, 1).count("H") == 1
    writer.frame([line("0.10 and 0.20")], 20, 1)
    assert writer.frame([line("0.11 and 0.21")], 20, 1).count("H") == 2


def test_the_last_cell_is_written_without_a_scroll_also_where_wrapping_is_immediate() -> None:
    writer, terminal = FrameWriter(), Terminal(4, 2)
    output = writer.frame([line("aaaa"), line("bbbb")], 4, 2)
    terminal.write(output)
    assert terminal.screen.display == ["aaaa", "bbbb"]
    assert output.index("\x1b[?7l") < output.index("bbbb") < output.index("\x1b[?7h")


def test_no_line_feed_is_ever_written() -> None:
    output = FrameWriter().frame([line("a" * 50)] * 30, 20, 10)
    assert "\n" not in output
    assert "\r" not in output


@pytest.mark.parametrize("char", ["\x1b", "\n", "\x00", "\x7f", "\x9b"])
def test_no_control_character_passes_even_if_a_display_let_it(char: str) -> None:
    terminal = Terminal(8, 1)
    terminal.write(FrameWriter().frame([line(f"a{char}[2Jb")], 8, 1))
    assert terminal.screen.display == ["a?[2Jb  "]


def test_without_colours_a_stop_is_reverse_and_nothing_has_a_colour() -> None:
    terminal = Terminal(9, 2)
    terminal.write(FrameWriter(colours=False).frame([line("STOPPED", Tone.STOP_BANNER), line("READY")], 9, 2))
    cells = terminal.cells()
    assert cells[0][0] == ("S", ("default", "default", True, True))
    assert cells[1][0] == ("R", ("default", "default", False, False))
    assert {(fg, bg) for row in cells for _, (fg, bg, _, _) in row} == {("default", "default")}


@pytest.mark.parametrize(("columns", "rows"), [(0, 5), (5, 0), (-1, -1)])
def test_a_terminal_without_cells_is_shown_nothing(columns: int, rows: int) -> None:
    assert FrameWriter().frame([line("a")], columns, rows) == ""
