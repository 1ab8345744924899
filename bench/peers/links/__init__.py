"""One file for each transport: `connect` for relays and drivers, `hold` and `watch` for presence.

    connect(address, role, heard) -> send    connect as "relay" or "driver"; heard(payload) is called on any thread
    hold(address)                            be present until the process is killed; return when others see it
    watch(address, lost)                     call lost() on any thread when the holder is gone

A payload is a planar Twist, six doubles, 48 bytes. Functions whose transport needs no such role are absent.
"""

from importlib import import_module
from types import ModuleType


def link_of(name: str) -> ModuleType:
    """Import the file of a transport; each one needs packages that other environments lack."""
    return import_module(f"{__name__}.{name}_link")
