"""The table of all commands: its columns, its lines, and what it does with long words, wide characters and colours."""

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from rich.cells import cell_len
from rich.console import Console
from rich.text import Text

from deploy.stack.table import GAP, INDENT, Column, Table, facts

WIDTHS = (40, 60, 80, 120)
PATH = "/opt/lifeline/robots/warehouse/robot.toml"
SENTENCE = "the base moves although zero is commanded, which proves that it does not obey the supervisor"


def printed(table: Table, width: int) -> list[str]:
    console = Console(width=width)
    with console.capture() as capture:
        console.print(table)
    return capture.get().splitlines()


def styled(table: Table, width: int, style: str) -> str:
    """Return all characters that have a style, without spaces."""
    console = Console(width=width)
    found = [
        segment.text
        for line in console.render_lines(table, pad=False)
        for segment in line
        if segment.style == console.get_style(style)
    ]
    return "".join("".join(found).split())


def report() -> Table:
    table = Table("robot", Column("Hz", right=True), Column("mode", style="green"), "says")
    table.add_row("robot1", "9.9", "READY", SENTENCE)
    table.add_row("機器人二號", "100.0", Text("STOPPED", "bold red"), f"see {PATH} for the reason")
    return table


@pytest.mark.parametrize("width", WIDTHS)
def test_no_line_is_wider_than_the_terminal_and_no_word_is_broken(width: int) -> None:
    lines = printed(report(), width)
    assert max(map(cell_len, lines)) <= width
    words = [word for line in lines for word in line.split()]
    for text in (SENTENCE, f"see {PATH} for the reason") if width > len(PATH) + INDENT else (SENTENCE,):
        assert set(text.split()) <= set(words)


@pytest.mark.parametrize("width", WIDTHS)
def test_a_cell_begins_below_its_heading_also_after_wide_characters(width: int) -> None:
    lines = printed(report(), width)
    for heading, cells in (("mode", ("READY", "STOPPED")), ("says", ("the base", "see"))):
        begins = {
            cell_len(line[: line.index(text)]) for text in (heading, *cells) for line in lines if text in line
        }
        assert len(begins) == 1, lines


@pytest.mark.parametrize("width", WIDTHS)
def test_numbers_end_below_the_end_of_their_heading(width: int) -> None:
    lines = printed(report(), width)
    texts = ("Hz", " 9.9", "100.0")
    ends = [
        cell_len(line[: line.index(text) + len(text)]) for text in texts for line in lines if text in line
    ]
    assert (len(ends), len(set(ends))) == (3, 1)


@pytest.mark.parametrize("width", WIDTHS)
def test_colours_stay_with_their_words_and_the_heading_is_dim(width: int) -> None:
    assert styled(report(), width, "dim") == "robotHzmodesays"
    assert styled(report(), width, "bold red") == "STOPPED"
    assert styled(report(), width, "green") == "READY"
    warning = facts()
    warning.add_row("alarm", Text(SENTENCE, "yellow"))
    assert styled(warning, width, "yellow") == SENTENCE.replace(" ", "")
    assert styled(warning, width, "dim") == "alarm"


def test_a_row_without_room_for_its_words_continues_in_a_second_line_and_so_does_the_heading() -> None:
    table = Table("topic", "type", "may write")
    table.add_row("robot/supervisor/status", "SafetyStatus", "supervisor")
    table.add_row("robot/estop", "Bool", "")
    assert printed(table, 60) == [
        "topic                    type          may write",
        "robot/supervisor/status  SafetyStatus  supervisor",
        "robot/estop              Bool",
    ]
    assert printed(table, 40) == [
        "topic                    type",
        "  may write",
        "robot/supervisor/status  SafetyStatus",
        "  supervisor",
        "robot/estop              Bool",
    ]


def test_a_column_has_its_width_if_there_is_room_and_at_least_its_least_width() -> None:
    table = Table("robot", Column("speed", 9, 20), "link")
    table.add_row("a", "0.00 m/s, 0.00 rad/s", "0.1 s")
    assert printed(table, 40)[1] == "a      0.00 m/s, 0.00 rad/s  0.1 s"
    assert printed(table, 23)[1:] == ["a      0.00 m/s,  0.1 s", "       0.00", "       rad/s"]
    assert printed(table, 18) == ["robot", "  speed", "  link", "a", "  0.00 m/s, 0.00", "  rad/s", "  0.1 s"]


def test_the_last_column_of_a_line_extends_to_the_end_of_the_terminal() -> None:
    table = Table("mode", Column("reasons", 8, 8))
    table.add_row("STOPPED", "OBSTACLE, OVERRUN (over)")
    assert printed(table, 40)[1] == "STOPPED  OBSTACLE, OVERRUN (over)"


def test_a_table_without_names_has_no_heading_and_its_title_comes_first() -> None:
    table = facts("tcp/127.0.0.1:7447")
    table.add_row("mode", "READY")
    assert printed(table, 40) == ["tcp/127.0.0.1:7447", "mode  READY"]


def test_markup_in_a_cell_is_text() -> None:
    table = facts()
    table.add_row("use", "[sim] and [bold]")
    assert printed(table, 40) == ["use  [sim] and [bold]"]


@example(rows=[("", "", "")], width=2)
@given(
    st.lists(st.tuples(*[st.text("ab 機é\n", max_size=90)] * 3), min_size=1, max_size=4),
    st.integers(1, 130),
)
def test_every_character_is_shown_on_any_terminal(rows: list[tuple[str, str, str]], width: int) -> None:
    table = Table("x", Column("y", right=True), "z")
    for row in rows:
        table.add_row(*row)
    shown = sorted("".join("".join(printed(table, width)).split()))
    if width > INDENT + GAP:
        assert shown == sorted("xyz" + "".join("".join("".join(row).split()) for row in rows))
