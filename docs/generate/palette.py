"""The colours and the style of the drawings in docs/images."""

import matplotlib as mpl
from matplotlib.axes import Axes

INK, GREY, LIGHT = "#20262e", "#7a8490", "#d9dee4"
ROBOT, RING, DANGER, GOOD = "#3a6ea5", "#e8a33d", "#c8443c", "#3f8f5b"
HIDDEN, REMEMBERED = "#8a4fb0", "#b3760a"
UNDATED = {"Date": None, "Creator": None}
"""Metadata of an SVG, so that the same figures give the same file."""


def style(salt: str = "") -> None:
    """Set the fonts and colours of all drawings of this process; a fixed salt gives the same SVG for the same figures."""
    mpl.rcParams.update(
        {
            "font.size": 10,
            "axes.edgecolor": GREY,
            "text.color": INK,
            "axes.labelcolor": INK,
            "svg.hashsalt": salt,
        }
    )


def plain(axes: Axes) -> None:
    """Draw axes without a box, with a light grid."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(color=LIGHT, lw=0.6)
