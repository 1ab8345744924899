r"""Convert lines to the minimal terminal output that shows them.

The writer keeps the cells of the last frame and writes only runs of changed cells, so that nothing scrolls or flickers.
It disables automatic wrapping meanwhile, because a character in the last cell of the last line would scroll the screen
on some terminals. Terminals with mode 2026 hold the frame back until it is complete; others ignore the mode.
"""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from teleop.screen.view import Line, Tone

Cells = npt.NDArray[np.uint32]
"""(rows x columns,): the character's code point, with the number of its tone in the bits above TONE_SHIFT."""

GAP = 6
"""Changes at most this many cells apart are written as one run, because that is shorter than moving the cursor."""
TONE_SHIFT = 24
CODE_POINT = (1 << TONE_SHIFT) - 1

_TONES = tuple(Tone)
_NUMBERS = {tone: bytes([number]) for number, tone in enumerate(_TONES)}
_STYLES = {
    Tone.PLAIN: ("0", "0"),
    Tone.DIM: ("0;90", "0;2"),
    Tone.STRONG: ("0;1", "0;1"),
    Tone.GOOD: ("0;32", "0"),
    Tone.CAUTION: ("0;1;33", "0;1"),
    Tone.STOP: ("0;1;31", "0;1"),
    Tone.GOOD_BANNER: ("0;30;42", "0;7"),
    Tone.CAUTION_BANNER: ("0;30;43", "0;7"),
    Tone.STOP_BANNER: ("0;1;97;41", "0;1;7"),
}
"""Parameters of the control sequence of each tone, with colours and without."""
_BEGIN, _END = "\x1b[?2026h\x1b[?7l", "\x1b[0m\x1b[?7h\x1b[?2026l"
_CLEAR = "\x1b[0m\x1b[2J"


class FrameWriter:
    """Remembers what a terminal shows.

    Args:
        colours: False: use only bold, faint and reverse.
    """

    def __init__(self, *, colours: bool = True) -> None:
        self._styles = [f"\x1b[{_STYLES[tone][0 if colours else 1]}m" for tone in _TONES]
        self._shown: Cells | None = None
        self._size = (0, 0)

    def forget(self) -> None:
        """Redraw everything next time, because the content of the terminal is unknown after other or partial output."""
        self._shown = None

    def frame(self, lines: Sequence[Line], columns: int, rows: int) -> str:
        """Return the output after which the terminal shows exactly `lines` from its first row on; may be empty.

        Text beyond `columns` x `rows` is cut off.
        """
        if columns < 1 or rows < 1:
            return ""
        cells = _cells(lines, columns, rows)
        shown, clear = self._shown, ""
        if shown is None or self._size != (columns, rows):
            shown, clear = np.full_like(cells, ord(" ")), _CLEAR
        self._shown, self._size = cells, (columns, rows)
        changes = self._changes(shown, cells, columns)
        return f"{_BEGIN}{clear}{changes}{_END}" if clear or changes else ""

    def _changes(self, shown: Cells, cells: Cells, columns: int) -> str:
        at = np.flatnonzero(shown != cells)
        if not at.size:
            return ""
        new_span = (np.diff(at) > GAP) | (np.diff(at // columns) != 0)
        firsts = at[np.concatenate(([True], new_span))]
        ends = at[np.concatenate((new_span, [True]))] + 1
        # Split every span where its tone changes.
        tones = cells >> TONE_SHIFT
        edges = np.flatnonzero(np.diff(tones)) + 1
        span = np.searchsorted(firsts, edges, side="right") - 1
        edges = edges[(span >= 0) & (edges > firsts[span]) & (edges < ends[span])]
        # np.union1d is avoided: its first use loads masked arrays, which take 5 MB.
        begins = sorted({*firsts.tolist(), *edges.tolist()})
        stops = sorted({*ends.tolist(), *edges.tolist()})
        text = (cells & CODE_POINT).astype("<u4").tobytes().decode("utf-32-le")
        places = set(firsts.tolist())
        parts: list[str] = []
        tone_now = -1
        for begin, stop in zip(begins, stops, strict=True):
            tone = int(tones[begin])
            if begin in places:
                parts.append(f"\x1b[{begin // columns + 1};{begin % columns + 1}H")
            if tone != tone_now:
                parts.append(self._styles[tone])
                tone_now = tone
            parts.append(text[begin:stop])
        return "".join(parts)


def _cells(lines: Sequence[Line], columns: int, rows: int) -> Cells:
    texts: list[str] = []
    tones: list[bytes] = []
    for line in lines[:rows]:
        left = columns
        for segment in line:
            text = segment.text[:left]
            texts.append(text)
            tones.append(_NUMBERS[segment.tone] * len(text))
            left -= len(text)
        texts.append(" " * left)
        tones.append(_NUMBERS[Tone.PLAIN] * left)
    missing = columns * (rows - len(lines[:rows]))
    texts.append(" " * missing)
    tones.append(_NUMBERS[Tone.PLAIN] * missing)
    codes = np.frombuffer("".join(texts).encode("utf-32-le", "replace"), dtype="<u4").astype(np.uint32)
    codes[(codes < ord(" ")) | ((codes >= 0x7F) & (codes < 0xA0))] = ord("?")  # remove control characters
    return codes | np.left_shift(np.frombuffer(b"".join(tones), dtype=np.uint8), TONE_SHIFT, dtype=np.uint32)
