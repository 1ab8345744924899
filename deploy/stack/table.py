"""The tables of all commands: aligned columns below a dim heading. A cell wraps between words.

A row that is too wide for the terminal continues in a second line, with columns of its own, and so does the heading:

    robot                      mode     owner
      speed                    nearest

A word is broken only if it is longer than a line of the terminal.
"""

from collections.abc import Iterator, Sequence
from itertools import zip_longest
from typing import NamedTuple

from rich.cells import cell_len
from rich.console import Console, ConsoleOptions
from rich.text import Text

from wire.text import printable, printable_lines

GAP = 2
"""Spaces between two columns."""
INDENT = 2
"""Spaces before the second line of a row, and each later one."""


class Column(NamedTuple):
    """A column. With `least` and `width`, its width depends only on that of the terminal, as long as its words fit."""

    name: str = ""
    least: int = 0
    """Least width; its longest word may need more."""
    width: int = 0
    """Width if there is room; 0: that of its longest cell."""
    right: bool = False
    """Whether its cells end at its right edge; these do not wrap."""
    style: str = ""


class Table:
    """A table for a Rich console. A cell that is a string may have a foreign name: it is made printable."""

    def __init__(self, *columns: Column | str, title: str = "") -> None:
        self._columns = [Column(one) if isinstance(one, str) else one for one in columns]
        self._title = title
        self._rows: list[list[Text]] = []

    def add_row(self, *cells: Text | str, style: str = "") -> None:
        self._rows.append(
            [
                Text(printable_lines(cell), style or column.style) if isinstance(cell, str) else cell
                for column, cell in zip(self._columns, cells, strict=True)
            ]
        )

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> Iterator[Text]:
        heading = [Text(column.name, "dim") for column in self._columns]
        rows = [heading, *self._rows]
        lines = _lines(self._columns, rows, options.max_width)
        if self._title:
            yield Text(printable(self._title), "bold")
        for row in rows:
            for number, widths in enumerate(lines):
                yield from self._line(console, row, widths, INDENT if number else 0)

    def _line(self, console: Console, row: list[Text], widths: dict[int, int], indent: int) -> Iterator[Text]:
        """Yield a line of a row, as high as its highest cell; nothing if all cells are empty."""
        if not any(row[at].plain for at in widths):
            return
        wrapped = [row[at].wrap(console, width, overflow="fold") for at, width in widths.items()]
        for parts in zip_longest(*wrapped):
            line = Text(" " * indent)
            for part, (at, width) in zip(parts, widths.items(), strict=True):
                cell = part or Text()
                cell.align("right" if self._columns[at].right else "left", width)
                line.append_text(cell).append(" " * GAP)
            line.rstrip()
            yield line


def facts(title: str = "") -> Table:
    """Return an empty table with a name and a value in each row."""
    return Table(Column(style="dim"), "", title=title)


def _lines(columns: Sequence[Column], rows: Sequence[Sequence[Text]], width: int) -> list[dict[int, int]]:
    """Return the columns of each line with their widths."""
    texts = ["\n".join(cell.plain for cell in cells) for cells in zip(*rows, strict=True)]
    longest = [max(map(cell_len, text.splitlines()), default=0) for text in texts]
    words = [max(map(cell_len, text.split()), default=0) for text in texts]
    sizes = [
        longest[at] if column.right else max(column.least, words[at]) for at, column in enumerate(columns)
    ]
    if sum(sizes) + GAP * (len(sizes) - 1) > width:
        sizes = [max(size, column.width) for size, column in zip(sizes, columns, strict=True)]
    lines = _packed(sizes, width)
    for number, line in enumerate(lines):
        free = max(0, width - (INDENT if number else 0) - sum(line.values()) - GAP * (len(line) - 1))
        needs = {at: max(0, (columns[at].width or longest[at]) - size) for at, size in line.items()}
        for at in sorted(needs, key=lambda at: needs[at]):
            growth = min(needs[at], free)
            line[at] += growth
            free -= growth
        if not columns[max(line)].right:
            line[max(line)] += free  # nothing begins after the last column
    return lines


def _packed(sizes: Sequence[int], width: int) -> list[dict[int, int]]:
    """Return the columns of each line with their sizes; a size that is too large for a line is cut to it."""
    lines: list[dict[int, int]] = [{}]
    free = width
    for at, size in enumerate(sizes):
        if lines[-1] and size > free:
            lines.append({})
            free = width - INDENT
        lines[-1][at] = max(1, min(size, free))
        free -= lines[-1][at] + GAP
    return lines
