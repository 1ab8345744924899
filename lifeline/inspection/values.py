"""Messages as plain values: as YAML, as CSV, one field of them, and back from YAML. Pure."""

import csv
import dataclasses
import io
import json
import math
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, cast

import numpy as np
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from wire.messages import Bool, M, Message, Point, Twist, Vector3
from wire.text import printable

MAX_YAML = 4096
"""Longest accepted YAML text, in characters."""

LARGEST = sys.float_info.max
"""No number of a message is larger; NaN does not compare, and an integer is compared exactly."""

PLAIN_TEXT = re.compile(r"[A-Za-z_/][A-Za-z0-9_/]*")
"""Text that YAML reads as text without quotation marks, except `WORDS`."""
WORDS = frozenset({"true", "false", "yes", "no", "on", "off", "null", "y", "n"})


class ValueRefusedError(ValueError):
    """A field or a YAML text does not fit the message; the message says why."""


def plain_value(value: object) -> Any:  # noqa: ANN401 - the nesting depends on the message
    """Return a message or a part of it as dicts, lists, numbers and strings."""
    if dataclasses.is_dataclass(value):
        return {name: plain_value(one) for name, one in _fields(value).items()}
    if isinstance(value, np.ndarray):
        return cast("list[Any]", value.tolist())
    if isinstance(value, (list, tuple)):
        return [plain_value(one) for one in cast("Sequence[object]", value)]
    return printable(value) if isinstance(value, str) else value


def select(value: object, path: str) -> object:
    """Return one field of a plain value: `linear.x`, `ranges.0`, `sources.1.name`.

    Raises:
        ValueRefusedError: there is no such field.
    """
    at: object = value
    for part in path.split("."):
        if isinstance(at, dict):
            fields = cast("dict[str, object]", at)
            if part not in fields:
                raise ValueRefusedError(
                    f"there is no field {part!r}; there are {', '.join(fields) or 'none'}"
                )
            at = fields[part]
        elif isinstance(at, list):
            items = cast("list[object]", at)
            if not part.isdecimal() or int(part) >= len(items):
                raise ValueRefusedError(f"{part!r} is not an index of a list with {len(items)} items")
            at = items[int(part)]
        else:
            raise ValueRefusedError(f"there is no field {part!r} in a single value")
    return at


def to_yaml(value: object) -> str:
    """Return a plain value as YAML, with mappings and lists of single values on one line.

    A general YAML library takes 30 ms for a scan of 360 beams: too slow to print every message of a robot.
    """
    return "\n".join(_lines(value)) + "\n"


def _lines(value: object) -> Iterator[str]:
    """Yield the lines of a value in block style."""
    if isinstance(value, dict) and value:
        for name, one in cast("dict[str, object]", value).items():
            if _is_flat(one):
                yield f"{name}: {_flow(one)}"
            else:
                yield f"{name}:"
                yield from (f"  {line}" for line in _lines(one))
    elif isinstance(value, list) and not _is_flat(cast("object", value)):
        for one in cast("list[object]", value):
            first, *rest = _lines(one)
            yield f"- {first}"
            yield from (f"  {line}" for line in rest)
    else:
        yield _flow(value)  # pyright: ignore[reportUnknownArgumentType]


def _is_flat(value: object) -> bool:
    """Return whether a value fits on one line: it contains no mapping or list that is not empty."""
    if isinstance(value, dict):
        return not any(_is_filled(one) for one in cast("dict[str, object]", value).values())
    return not isinstance(value, list) or not any(map(_is_filled, cast("list[object]", value)))


def _is_filled(value: object) -> bool:
    return isinstance(value, (dict, list)) and bool(value)  # pyright: ignore[reportUnknownArgumentType]


def _flow(value: object) -> str:
    if isinstance(value, dict):
        inner = cast("dict[str, object]", value).items()
        return f"{{{', '.join(f'{name}: {_flow(one)}' for name, one in inner)}}}"
    if isinstance(value, list):
        return f"[{', '.join(map(_flow, cast('list[object]', value)))}]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float) and not math.isfinite(value):
        return ".nan" if math.isnan(value) else ".inf" if value > 0 else "-.inf"
    if isinstance(value, str):
        return value if PLAIN_TEXT.fullmatch(value) and value.lower() not in WORDS else json.dumps(value)
    return repr(value)


def leaves(value: object, prefix: str = "") -> Iterator[tuple[str, object]]:
    """Yield the path and the value of each single value in a plain value."""
    if isinstance(value, dict):
        for name, one in cast("dict[str, object]", value).items():
            yield from leaves(one, f"{prefix}.{name}" if prefix else name)
    elif isinstance(value, list):
        for number, one in enumerate(cast("list[object]", value)):
            yield from leaves(one, f"{prefix}.{number}" if prefix else str(number))
    else:
        yield prefix, value


def csv_line(values: Sequence[object]) -> str:
    """Return a line of CSV."""
    stream = io.StringIO()
    csv.writer(stream, lineterminator="").writerow(values)
    return stream.getvalue()


def defaults_of(message_type: type[M]) -> M:
    """Return a message with zeros, of one of the types that may be published from the command line.

    Raises:
        ValueRefusedError: messages of this type cannot be published from the command line.
    """
    zeros: dict[type[Any], Message] = {
        Twist: Twist(Vector3(0.0, 0.0, 0.0), Vector3(0.0, 0.0, 0.0)),
        Bool: Bool(data=False),
        Point: Point(0.0, 0.0, 0.0),
    }
    if message_type not in zeros:
        raise ValueRefusedError(f"{message_type.__msgtype__} cannot be published from the command line")
    return cast("M", zeros[message_type])


def from_yaml(text: str, message_type: type[M]) -> M:
    """Return a message from YAML such as `{linear: {x: 0.1}}`; fields that are not given are zero.

    Raises:
        ValueRefusedError: it is not YAML, or a field does not fit the type.
    """
    if len(text) > MAX_YAML:
        raise ValueRefusedError(f"the text is longer than {MAX_YAML} characters")
    try:
        # The pure safe loader makes no objects, and aliases cannot grow what a fixed set of fields reads.
        value: object = YAML(typ="safe", pure=True).load(text)
    except (YAMLError, ValueError, LookupError, RecursionError) as error:
        first = str(error).splitlines()[0] if str(error) else "unreadable"
        raise ValueRefusedError(f"this is not YAML: {printable(first)}") from error
    return _filled(defaults_of(message_type), {} if value is None else value, message_type.__msgtype__)


def _filled(default: M, value: object, where: str) -> M:
    """Return a copy of a message with the values of a mapping."""
    if not isinstance(value, Mapping):
        example = ", ".join(f"{name}: …" for name in _fields(default))
        raise ValueRefusedError(f"{where} needs a mapping such as {{{example}}}")
    given = cast("Mapping[object, object]", value)
    known = _fields(default)
    for name in given:
        if name not in known:
            raise ValueRefusedError(f"{where} has no field {str(name)!r}; it has {', '.join(known)}")
    new: dict[str, Any] = {}
    for name, old in known.items():
        if name not in given:
            new[name] = old
        elif dataclasses.is_dataclass(old):
            new[name] = _filled(cast("Any", old), given[name], name)
        else:
            new[name] = _single(old, given[name], name)
    return type(default)(**new)


def _fields(message: object) -> dict[str, Any]:
    names = (field.name for field in dataclasses.fields(cast("Any", message)))
    return {name: getattr(message, name) for name in names if not name.startswith("__")}


def _single(old: object, value: object, name: str) -> object:
    if isinstance(old, bool):
        if isinstance(value, bool):
            return value
        raise ValueRefusedError(f"{name} is true or false")
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) <= LARGEST:
        raise ValueRefusedError(f"{name} is a finite number")
    return float(value)


def finite(value: object) -> object:
    """Return a plain value for JSON: None instead of NaN and infinity."""
    if isinstance(value, dict):
        return {name: finite(one) for name, one in cast("dict[str, object]", value).items()}
    if isinstance(value, list):
        return [finite(one) for one in cast("list[object]", value)]
    return None if isinstance(value, float) and not math.isfinite(value) else value
