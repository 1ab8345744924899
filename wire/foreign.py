"""JSON and TOML that others wrote, such as files: bounded size, depth and numbers, and exactly one kind of error."""

import json
import math
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

MAX_DEPTH = 64
MAX_DIGITS = 20
"""Of an integer: enough for 64 bits."""
MAX_BYTES = 4 << 20
"""Of a whole file; a configuration or a record has a few kilobytes."""


class ForeignError(ValueError):
    """The content cannot be used; the message says why."""


def read_text(path: Path, most_bytes: int | None = None) -> str:
    """Return the content of a file, without the byte order mark that some editors write.

    Args:
        path: the file.
        most_bytes: a larger file is refused; None: `MAX_BYTES`.

    Raises:
        OSError: the file cannot be read.
        ForeignError: it is too large, or is not text.
    """
    if path.is_fifo():
        raise ForeignError("it is a pipe, and would be waited for")
    most = MAX_BYTES if most_bytes is None else most_bytes
    with path.open("rb") as file:
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
    """Return the tables of a TOML text; its numbers are as they are written.

    Raises:
        ForeignError: it is not TOML, or is nested too deeply.
    """
    return _bounded(lambda: tomllib.loads(text))


def _bounded(load: Callable[[], Any]) -> Any:  # noqa: ANN401 - as the two above
    try:
        document = load()
        _check_depth(document, MAX_DEPTH)
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


def _check_depth(value: object, levels: int) -> None:
    if not isinstance(value, dict | list):
        return
    if levels == 0:
        raise ForeignError("it is nested too deeply")
    items = (
        cast("dict[str, object]", value).values() if isinstance(value, dict) else cast("list[object]", value)
    )
    for item in items:
        _check_depth(item, levels - 1)
