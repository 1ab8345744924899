"""Find the numbers, lengths and texts of a CDR payload by its type's definition."""

import struct
from typing import Any, NamedTuple

from rosbags.interfaces import Nodetype
from rosbags.typesys import get_types_from_msg

from wire.messages import definition

HEADER_BYTES = 4
SIZES = {
    "bool": 1,
    "byte": 1,
    "char": 1,
    "int8": 1,
    "uint8": 1,
    "int16": 2,
    "uint16": 2,
    "int32": 4,
    "uint32": 4,
    "int64": 8,
    "uint64": 8,
    "float32": 4,
    "float64": 8,
}


class Place(NamedTuple):
    """One primitive of a payload."""

    kind: str
    """A name of `SIZES`, or "length"."""
    offset: int
    """From the payload's first byte."""
    size: int


def places(payload: bytes, type_name: str) -> tuple[Place, ...]:
    """Return all primitives of a valid payload, in order.

    Raises:
        ValueError: the definition does not end with the payload.
    """
    text = definition(type_name).text
    walk = _Walk(payload, get_types_from_msg(text, type_name))
    walk.message(type_name)
    if walk.at != len(payload):
        raise ValueError(f"{type_name}: {walk.at} of {len(payload)} bytes are accounted for")
    return tuple(walk.found)


class _Walk:
    def __init__(self, payload: bytes, types: Any) -> None:  # noqa: ANN401 - rosbags' own
        self._payload, self._types = payload, types
        self._order = "<" if payload[1] else ">"
        self.at = HEADER_BYTES
        self.found: list[Place] = []

    def message(self, type_name: str) -> None:
        for _, node in self._types[type_name][1]:
            self._node(node)

    def _node(self, node: Any) -> None:  # noqa: ANN401 - rosbags' own
        kind, what = node
        match kind:
            case Nodetype.BASE if what[0] == "string":
                length = self._length()  # which moves on itself
                self.at += length
            case Nodetype.BASE:
                self._take(what[0], SIZES[what[0]])
            case Nodetype.NAME:
                self.message(what)
            case _:
                item, fixed = what
                for _ in range(fixed if kind == Nodetype.ARRAY else self._length()):
                    self._node(item)

    def _length(self) -> int:
        place = self._take("length", 4)
        return int(struct.unpack_from(f"{self._order}I", self._payload, place.offset)[0])

    def _take(self, kind: str, size: int) -> Place:
        body = self.at - HEADER_BYTES
        place = Place(kind, HEADER_BYTES + -(-body // size) * size, size)
        self.found.append(place)
        self.at = place.offset + size
        return place
