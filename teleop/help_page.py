"""All keys of the control mode as a page, for any number of columns and rows.

One row for each function if there is room; otherwise the rows run on, and what still does not fit is counted.
"""

import textwrap
from collections.abc import Sequence

from teleop.view import KeyHelp, Line, Segment, Tone

KEY_COLUMNS = 8
"""Width of the column of keys; longer names of keys extend into the next column."""


def help_page(rows: Sequence[KeyHelp], columns: int, height: int) -> list[Line]:
    """Return at most `height` lines of at most `columns` characters."""
    if columns < 1 or height < 1:
        return []
    table = [line for row in rows for line in _row(row, columns)]
    if len(table) <= height:
        return table
    words = "; ".join(f"{row.keys}: {row.does}" for row in rows)
    flow = textwrap.wrap(words, columns)
    if len(flow) > height:
        flow[height - 1 :] = ["more keys: enlarge the terminal"[:columns]]
    return [(Segment(line),) for line in flow]


def _row(row: KeyHelp, columns: int) -> list[Line]:
    """Return the lines of one function; a text that is too long continues below its beginning."""
    keys = f"{row.keys:<{KEY_COLUMNS - 1}} "
    text = f"{keys}{row.does}"
    if len(text) <= columns:
        return [(Segment(keys, Tone.STRONG), Segment(row.does))]
    indent = " " * min(KEY_COLUMNS, columns // 2)
    first, *others = textwrap.wrap(text, columns, subsequent_indent=indent) or [""]
    return [
        (Segment(first[: len(keys)], Tone.STRONG), Segment(first[len(keys) :])),
        *((Segment(other),) for other in others),
    ]
