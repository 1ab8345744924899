"""Text for screens, the same in every program: foreign text made printable, and bearings in words. Pure."""

import math

AHEAD_DEG = 10
"""Directions within this angle of straight ahead or behind are named "ahead" or "behind"."""


def printable(text: str) -> str:
    """Replace control characters of foreign text, so that no payload can control the terminal."""
    return "".join(char if char.isprintable() else "?" for char in text)


def printable_lines(text: str) -> str:
    """Replace control characters except line feeds."""
    return "\n".join(map(printable, text.split("\n")))


def bearing_in_words(bearing_rad: float, degree: str = "°") -> str:
    """Return a bearing in the base frame as text, such as "ahead" or "at 40° left"; empty if it is not finite.

    Args:
        bearing_rad: counter-clockwise from straight ahead.
        degree: the unit after the number, for a terminal without the character.
    """
    if not math.isfinite(bearing_rad):
        return ""
    degrees = round(math.degrees(math.remainder(bearing_rad, math.tau)))
    if abs(degrees) < AHEAD_DEG:
        return "ahead"
    if abs(degrees) > 180 - AHEAD_DEG:
        return "behind"
    return f"at {abs(degrees)}{degree} {'left' if degrees > 0 else 'right'}"
