"""Files, JSON and TOML that others wrote: regular files only, bounded size, depth and numbers, and exactly one kind of error."""

import errno
import json
import math
import os
import re
import stat
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any, cast

MAX_DEPTH = 64
MAX_DIGITS = 20
"""Of an integer: enough for 64 bits."""
MAX_BYTES = 4 << 20
"""Of a whole file; a configuration or a record has a few kilobytes."""
MAX_KEY_PARTS = 8
"""Of a key of TOML, such as the three of a.b.c; tomllib takes quadratic time and memory for them."""

NUL = re.compile(r"\\(?:u0000|U00000000)")
"""The escaped character of TOML, which refuses the character itself."""

# No possessive group is inside another one: Python 3.11 before 3.11.5 then matches too little (https://github.com/python/cpython/issues/101955).
_NEXT_PART = r"""\.[ \t]*+(?:[A-Za-z0-9_-]++|"[^"\\\n]*+(?:\\[^\n][^"\\\n]*+)*"|'[^'\n]*+')[ \t]*+"""
_SHORT_KEYS = re.compile(
    rf"""(?:
        [^"'\#.]++
      | \#[^\n]*+
      | \"{{3}}[^"\\]*+(?:(?:\\.|"(?!""))[^"\\]*+)*"{{3,5}}
      | '{{3}}[^']*+(?:'(?!'')[^']*+)*'{{3,5}}
      | "(?!"")[^"\\\n]*+(?:\\[^\n][^"\\\n]*+)*"
      | '(?!'')[^'\n]*+'
      | (?:{_NEXT_PART}){{1,{MAX_KEY_PARTS - 1}}}(?!{_NEXT_PART})
    )*+""",
    re.VERBOSE | re.DOTALL,
)
"""Matches TOML up to the first key with too many parts, or the first place that is not TOML, in linear time."""
_LONG_KEY = re.compile(rf"(?:{_NEXT_PART}){{{MAX_KEY_PARTS}}}")


class ForeignError(ValueError):
    """The content cannot be used; the message says why."""


def open_file(path: Path, opener: Callable[[str, int], int] = os.open) -> IO[bytes]:
    """Open a file for reading.

    Args:
        path: the file.
        opener: opens it, with its path and flags.

    Raises:
        OSError: it cannot be read, or is no regular file: a pipe or a device can block, and a device may have no end.
    """
    at_once = os.O_NONBLOCK | os.O_NOCTTY
    file = open(path, "rb", opener=lambda name, flags: opener(name, flags | at_once))  # noqa: SIM115 - the caller closes it; Path.open has no opener
    try:
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            raise OSError(errno.EINVAL, "it is a pipe or a device, not a file", str(path))  # noqa: TRY301 - closes it
        os.pread(file.fileno(), 1, 0)  # some files of /proc would block; this one then raises
    except BaseException:
        file.close()
        raise
    return file


def read_text(path: Path, most_bytes: int | None = None) -> str:
    """Return the content of a file, without the byte order mark that some editors write.

    Args:
        path: the file.
        most_bytes: a larger file is refused; None: `MAX_BYTES`.

    Raises:
        OSError: the file cannot be read.
        ForeignError: it is too large, or is not text.
    """
    most = MAX_BYTES if most_bytes is None else most_bytes
    with open_file(path) as file:
        content = file.read(most + 1)
    if len(content) > most:
        raise ForeignError(f"it is larger than {most >> 20} MiB")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ForeignError(f"it is not text: {error}") from error


def from_json(text: str) -> Any:  # noqa: ANN401 - any JSON value
    """Return the values of a JSON text; each number is finite, and each integer has at most `MAX_DIGITS` digits.

    Raises:
        ForeignError: it is not such a text, or is nested too deeply.
    """
    return _bounded(lambda: json.loads(text, parse_int=_integer, parse_float=_finite, parse_constant=_finite))


def from_toml(text: str) -> dict[str, Any]:
    """Return the tables of a TOML text; its numbers are as they are written, and each integer has at most `MAX_DIGITS` digits.

    Raises:
        ForeignError: it is not TOML, is nested too deeply, has the character NUL, or has a key of more than `MAX_KEY_PARTS` parts.
    """
    refuse_long_keys(text)
    if NUL.search(text) is not None:
        raise ForeignError("it has the character NUL, which no name has")
    return _bounded(lambda: tomllib.loads(text))


def refuse_long_keys(text: str) -> None:
    """Refuse a text of TOML, or a damaged one, with a key of more than `MAX_KEY_PARTS` parts.

    Raises:
        ForeignError: it has such a key; names its line.
    """
    short = _SHORT_KEYS.match(text)
    if short is not None and _LONG_KEY.match(text, short.end()) is not None:
        line = text.count("\n", 0, short.end()) + 1
        raise ForeignError(
            f"it is nested too deeply: a key in line {line} has more than {MAX_KEY_PARTS} parts"
        )


def _bounded(load: Callable[[], Any]) -> Any:  # noqa: ANN401 - as the two above
    try:
        document = load()
        _check(document, MAX_DEPTH)
    except RecursionError as error:
        raise ForeignError("it is nested too deeply") from error
    except ValueError as error:  # an integer of thousands of digits is not a TOMLDecodeError
        raise ForeignError(str(error)) from error
    return document


def _integer(digits: str) -> int:
    if len(digits) > MAX_DIGITS:
        raise ForeignError(f"{digits[:MAX_DIGITS]}… has more than {MAX_DIGITS} digits")
    return int(digits)


def _finite(digits: str) -> float:
    number = float(digits)
    if not math.isfinite(number):
        raise ForeignError(f"{digits:.40} is not a finite number")
    return number


def _check(value: object, levels: int) -> None:
    if isinstance(value, int) and abs(value) >= 10**MAX_DIGITS:  # of TOML, perhaps too large to print
        raise ForeignError(f"an integer has more than {MAX_DIGITS} digits")
    if not isinstance(value, dict | list):
        return
    if levels == 0:
        raise ForeignError("it is nested too deeply")
    items = (
        cast("dict[str, object]", value).values() if isinstance(value, dict) else cast("list[object]", value)
    )
    for item in items:
        _check(item, levels - 1)
