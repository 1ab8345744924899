"""Exact conversion of the law's types to plain values and JSON, and back, derived from their type hints.

A new or removed field of the model needs no change here. `pack` converts an object to nested lists of numbers,
strings and bytes for marshal, fast enough for every step. `spell` converts these to JSON with field names, which is
slower. `read` builds the object again from that JSON:

    float                      a number, or "NaN", "Infinity", "-Infinity"
    bytes                      base64
    array                      {"dtype": "<f4", "shape": [360], "base64": "…"}, its memory in C order
    enum                       its name
    tuple, frozenset           a list
    frozen dataclass, tuple    an object by field; {"type": "Circle", …} if the hint does not determine the class

Every float is restored bit for bit, except for the payload of a NaN.
"""

import base64
import math
import struct
import sys
import types
from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cache, partial
from operator import attrgetter
from typing import Any, Literal, NamedTuple, TypeVar, Union, cast, get_args, get_origin, get_type_hints

import numpy as np

T = TypeVar("T")

Convert = Callable[[Any], Any]


class Codec(NamedTuple):
    """Functions that pack, spell and read one type; `pack` and `spell` are not called with None."""

    pack: Convert
    spell: Convert
    read: Convert
    """Raises ValueError if the JSON does not fit the type; a null fits only a hint with None."""


def _same(value: object) -> object:
    return value


@cache
def codec(hint: Any) -> Codec:  # noqa: ANN401 - a hint may be any object
    """Return the codec of a type hint.

    Raises:
        TypeError: the type has no codec yet.
    """
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is None and isinstance(hint, type):
        return _class_codec(cast("type[Any]", hint))
    if origin in {Union, types.UnionType}:
        options = [option for option in arguments if option is not types.NoneType]
        one = codec(options[0]) if len(options) == 1 else _one_of(options)
        return one if len(options) == len(arguments) else one._replace(read=partial(_maybe, one.read))
    if origin is tuple and arguments[-1] is not ...:
        return _row(arguments)
    if origin in {tuple, list, frozenset}:
        return _list(origin, codec(arguments[0]))
    if origin is Literal:
        return codec(cast("type[Any]", type(arguments[0])))
    if origin is np.ndarray:
        return Codec(
            _pack_array, _spell_array, partial(_read_array, np.dtype(get_args(arguments[1])[0]).kind)
        )
    raise TypeError(f"a black box cannot hold a {hint}")


def _class_codec(cls: type[Any]) -> Codec:
    if cls in _SCALARS:
        return _SCALARS[cls]
    if issubclass(cls, Enum):
        return Codec(attrgetter("_name_"), _same, _enum_reader(cls))
    if is_dataclass(cls) or hasattr(cls, "_fields"):
        return record_codec(cls)
    if getattr(cls, "_is_protocol", False):
        return _one_of(_implementations(cls))
    raise TypeError(f"a black box cannot hold a {cls}")


def _implementations(protocol: type[Any]) -> list[type[Any]]:
    """Return the dataclasses in the protocol's module that have all of its members."""
    asked = {name for name in vars(protocol) if not name.startswith("_")}
    beside = vars(sys.modules[protocol.__module__]).values()
    return [
        t
        for t in beside
        if isinstance(t, type) and is_dataclass(t) and asked <= {*dir(t), *t.__dataclass_fields__}
    ]


def record_codec(cls: type[Any], *, without: Iterable[str] = ()) -> Codec:
    """Return the codec of a frozen dataclass or NamedTuple, without the given fields."""
    names = [f.name for f in fields(cls)] if is_dataclass(cls) else list(cls._fields)
    names = [name for name in names if name not in without]
    hints = get_type_hints(cls)
    codecs = {name: codec(hints[name]) for name in names}
    packs = tuple((i, c.pack) for i, c in enumerate(codecs.values()) if c.pack is not _same)
    spells = tuple((name, c.spell) for name, c in codecs.items() if c.spell is not _same)
    get = _getter(names)

    def pack(value: object) -> list[Any]:
        row = list(get(value))
        for i, pack_field in packs:
            if row[i] is not None:
                row[i] = pack_field(row[i])
        return row

    def spell(row: list[Any]) -> dict[str, Any]:
        document = dict(zip(names, row, strict=True))
        for name, spell_field in spells:
            if document[name] is not None:
                document[name] = spell_field(document[name])
        return document

    def read(document: object) -> object:
        given = _read_object(document)
        unknown = given.keys() - codecs.keys()
        if unknown:
            raise ValueError(f"{cls.__name__} has no {min(unknown):.60}")
        try:
            return cls(**{name: codecs[name].read(value) for name, value in given.items()})
        except TypeError as error:  # a field without a default is missing
            raise ValueError(f"{cls.__name__}: {error}") from error

    return Codec(pack, spell, read)


def _getter(names: list[str]) -> Callable[[Any], tuple[Any, ...]]:
    """Return a function that gets these attributes as a tuple, even for a single name, unlike attrgetter."""
    if len(names) > 1:
        return attrgetter(*names)
    return lambda value: tuple(getattr(value, name) for name in names)


def _one_of(options: Iterable[type[Any]]) -> Codec:
    """Return the codec of a hint that allows several classes; the class name is stored with the object."""
    codecs = {option.__name__: record_codec(option) for option in options}

    def pack(value: object) -> list[Any]:
        name = type(value).__name__
        return [name, codecs[name].pack(value)]

    def spell(packed: list[Any]) -> dict[str, Any]:
        name, row = packed
        return {"type": name, **codecs[name].spell(row)}

    def read(document: object) -> object:
        given = dict(_read_object(document))
        name = given.pop("type", None)
        if name not in codecs:
            raise ValueError(f"there is no type {name!s:.60}")
        return codecs[name].read(given)

    return Codec(pack, spell, read)


def _list(build: Callable[[Iterable[Any]], Any], item: Codec) -> Codec:
    def pack(values: Iterable[Any]) -> list[Any]:
        if item.pack is _same:
            return list(values)
        return [_maybe(item.pack, value) for value in values]

    def pack_set(values: Iterable[Any]) -> list[Any]:
        return sorted(pack(values))  # the order of a set differs between runs

    def spell(values: list[Any]) -> list[Any]:
        return [_maybe(item.spell, value) for value in values]

    def read(document: object) -> object:
        return build(map(item.read, _read_list(document)))

    return Codec(pack_set if build is frozenset else pack, spell, read)


def _row(hints: tuple[Any, ...]) -> Codec:
    """Return the codec of a tuple of fixed length, with one type for each item."""
    codecs = [codec(hint) for hint in hints]

    def pack(values: tuple[Any, ...]) -> list[Any]:
        return [_maybe(c.pack, value) for c, value in zip(codecs, values, strict=True)]

    def spell(values: list[Any]) -> list[Any]:
        return [_maybe(c.spell, value) for c, value in zip(codecs, values, strict=True)]

    def read(document: object) -> object:
        values = zip(codecs, _read_list(document), strict=True)
        return tuple(c.read(value) for c, value in values)

    return Codec(pack, spell, read)


def _maybe(convert: Convert, value: object) -> Any:  # noqa: ANN401 - the result of any conversion
    return None if value is None else convert(value)


# --- scalars, bytes, arrays and enums


def _reader(kind: type[T]) -> Callable[[object], T]:
    """Return a function that checks that a value is of this type, else raises ValueError; True is not a number."""

    def read(value: object) -> T:
        if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
            raise ValueError(f"{value!r:.60} is not of type {kind.__name__}")
        return value

    return read


_read_bool, _read_int, _read_str = _reader(bool), _reader(int), _reader(str)
_read_object: Callable[[object], dict[str, Any]] = _reader(dict)
_read_list: Callable[[object], list[Any]] = _reader(list)


_NOT_FINITE: Mapping[str, float] = {
    "NaN": float("nan"),
    "Infinity": float("inf"),
    "-Infinity": float("-inf"),
}


def _spell_float(value: float | bytes) -> float | str:
    # The type checker sees a numpy float64 as a float, but marshal packs it as a buffer.
    number = float(struct.unpack("=d", value)[0] if isinstance(value, bytes) else value)
    if math.isfinite(number):
        return number
    return "NaN" if math.isnan(number) else "Infinity" if number > 0 else "-Infinity"


def _read_float(value: object) -> float:
    if isinstance(value, str) and value in _NOT_FINITE:
        return _NOT_FINITE[value]
    if isinstance(value, bool) or not isinstance(value, float | int):
        raise ValueError(f"{value!r:.60} is not a number")  # noqa: TRY004 - the file is wrong, not the caller
    return float(value)


def _spell_bytes(value: bytes) -> str:
    return base64.b64encode(value).decode()


def _read_bytes(value: object) -> bytes:
    return base64.b64decode(_read_str(value), validate=True)


def _pack_array(array: np.ndarray) -> list[Any]:
    return [array.dtype.str, list(array.shape), array.tobytes()]


def _spell_array(packed: list[Any]) -> dict[str, Any]:
    dtype, shape, memory = packed
    return {"dtype": dtype, "shape": shape, "base64": _spell_bytes(memory)}


def _read_array(kind: str, value: object) -> np.ndarray:
    given = _read_object(value)
    try:
        dtype = np.dtype(_read_str(given["dtype"]))
        if dtype.kind != kind:
            raise ValueError(f"an array of {dtype!s:.60}")
        return np.frombuffer(_read_bytes(given["base64"]), dtype=dtype).reshape(given["shape"])
    except (KeyError, TypeError, OverflowError) as error:
        raise ValueError(f"{error!r:.80} in an array") from error


def _enum_reader(cls: type[Enum]) -> Callable[[object], Enum]:
    def read(value: object) -> Enum:
        try:
            return cls[_read_str(value)]
        except KeyError:
            raise ValueError(f"there is no {cls.__name__} {value!s:.60}") from None

    return read


_SCALARS: Mapping[type[Any], Codec] = {
    float: Codec(_same, _spell_float, _read_float),
    int: Codec(_same, _same, _read_int),
    bool: Codec(_same, _same, _read_bool),
    str: Codec(_same, _same, _read_str),
    bytes: Codec(_same, _spell_bytes, _read_bytes),
}
