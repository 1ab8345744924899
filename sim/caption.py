"""Caption of a picture: mode, stop reason, speed, and distance of the nearest object."""

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from sim.shown import COLOURS, Mode, Shown

Pixels = NDArray[np.uint8]

_PANEL = (18, 24, 32, 205)
_INK, _DIM = (255, 255, 255, 255), (190, 200, 210, 255)
_DARK_INK = (16, 20, 26, 255)
_LIGHT_MODES = (Mode.LIMITED, Mode.DRIVING, Mode.ALONE)


def captioned(pixels: Pixels, shown: Shown) -> Pixels:
    """Return the picture with a panel along its lower edge; in a narrow picture, the least important texts are omitted.

    Args:
        pixels: RGB, shape (height, width, 3); not modified.
        shown: The values to show.
    """
    picture = Image.fromarray(pixels).convert("RGBA")
    layer = Image.new("RGBA", picture.size, (0, 0, 0, 0))
    draw = ImageDraw.Draw(layer)
    unit = max(8, round(0.040 * picture.height))
    font = ImageFont.load_default(unit)
    margin, pad = unit, 0.55 * unit
    top, bottom = picture.height - margin - 2.0 * unit, float(picture.height - margin)
    middle = 0.5 * (top + bottom)

    badge_right = margin + 2 * pad + max(font.getlength(mode) for mode in Mode if mode is not Mode.ALONE)
    badge_right = max(badge_right, margin + 2 * pad + font.getlength(shown.mode))
    texts = [(shown.speed, _INK), (f"nearest {shown.nearest}", _INK), (shown.why, _DIM)]
    places: list[tuple[float, str, tuple[int, ...]]] = []
    x = badge_right + 1.5 * pad
    for number, (text, ink) in enumerate(texts):
        # Fields of fixed width keep the line still while digits change.
        width = max(font.getlength(text), font.getlength(("-0.00 m/s", "nearest 0.00 m", "")[number]))
        if not text or x + width + pad > picture.width - margin:
            break
        places.append((x, text, ink))
        x += width + 1.5 * pad

    draw.rounded_rectangle((margin, top, x - 0.5 * pad, bottom), radius=0.5 * unit, fill=_PANEL)
    colour = tuple(round(255 * part) for part in COLOURS[shown.mode])
    draw.rounded_rectangle((margin, top, badge_right, bottom), radius=0.5 * unit, fill=(*colour, 255))
    badge_ink = _DARK_INK if shown.mode in _LIGHT_MODES else _INK
    draw.text((0.5 * (margin + badge_right), middle), shown.mode, fill=badge_ink, font=font, anchor="mm")
    for x, text, ink in places:
        draw.text((x, middle), text, fill=ink, font=font, anchor="lm")
    return np.asarray(Image.alpha_composite(picture, layer).convert("RGB"))
