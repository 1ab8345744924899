"""A decoder of protobuf messages without their schemas."""

import struct
from typing import Any

Fields = dict[int, list[Any]]


def protobuf_fields(data: bytes) -> Fields:
    """Return the values of a protobuf message by field number: integers, 8 bytes as floats, all else as bytes."""
    fields: Fields = {}
    at = 0

    def varint() -> int:
        nonlocal at
        value = shift = 0
        while True:
            byte = data[at]
            at += 1
            value |= (byte & 0x7F) << shift
            shift += 7
            if byte < 0x80:
                return value

    while at < len(data):
        key = varint()
        match key & 7:
            case 0:
                value: Any = varint()
            case 1:
                (value,) = struct.unpack_from("<d", data, at)
                at += 8
            case 2:
                length = varint()
                value = data[at : at + length]
                at += length
            case wire_type:
                raise ValueError(f"unexpected wire type {wire_type}")
        fields.setdefault(key >> 3, []).append(value)
    return fields
