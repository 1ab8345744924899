"""One file for each transport: `connect` for relays and drivers, `hold` and `watch` for presence.

    connect(address, role, heard) -> send    connect as "relay" or "driver"; heard(payload) is called on any thread
    hold(address)                            be present until the process is killed; return when others see it
    watch(address, lost)                     call lost() on any thread when the holder is gone

A payload is a planar Twist of six doubles; its turning speed tells the messages apart. Functions whose transport needs no such role
are absent.
"""

import struct
from importlib import import_module
from types import ModuleType

PAYLOAD_BYTES = 48
CDR_HEADER = b"\x00\x01\x00\x00"
"""Before the payload in a message of ROS 2: little endian."""
_TURN = struct.Struct("<40xd")


def link_of(name: str) -> ModuleType:
    """Import the file of a transport; each one needs packages that other environments lack."""
    return import_module(f"{__name__}.{name}_link")


def payload_of(turn_rad_s: float) -> bytes:
    return _TURN.pack(turn_rad_s)


def turn_of(payload: bytes) -> float:
    """Return the turning speed of a payload [rad/s]."""
    return _TURN.unpack(payload)[0]
