"""Keyboard teleops in a terminal, and a person who holds a key.

teleop_twist_keyboard is a program of others (BSD licence) and is not in this repository. LIFELINE_TELEOP_TWIST_KEYBOARD
names its file; an installed ROS 2 may contain it. `key_teleop` stands in for it: it publishes on the same events.
"""

import os
import threading
from collections.abc import Generator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

import pexpect

from ros2.environment import ROS

VARIABLE = "LIFELINE_TELEOP_TWIST_KEYBOARD"
INSTALLED = ROS / "lib/teleop_twist_keyboard/teleop_twist_keyboard"
KEY_TELEOP = ("-m", "tests.ros2.peers.key_teleop")
LAB_TELEOP = ("-m", "tests.ros2.peers.lab_teleop")
REPEAT_DELAY_S, REPEAT_S = 0.4, 1.0 / 30.0
"""Of a held key: usual values of a desktop."""


def upstream_teleop() -> tuple[str, ...] | None:
    """Return the arguments that run teleop_twist_keyboard with the Python of ROS; None if it is not on this machine."""
    path = Path(os.environ.get(VARIABLE) or INSTALLED)
    return (str(path.absolute()),) if path.is_file() else None


@contextmanager
def holding(terminal: "pexpect.spawn[str]", key: str) -> Generator[None]:
    """Hold a key down: the terminal repeats it after a delay, until the block ends."""
    with pressing(terminal, [key], then=key):
        yield


@contextmanager
def pressing(terminal: "pexpect.spawn[str]", keys: Sequence[str], *, then: str | None) -> Generator[None]:
    """Press keys, then hold one until the block ends; what the program prints is read and dropped."""
    released = threading.Event()

    def type_keys() -> None:
        with suppress(OSError):  # the program may be killed while the key is held
            terminal.send("".join(keys))
            wait_s = REPEAT_DELAY_S
            while not released.wait(wait_s):
                if then is not None:
                    terminal.send(then)
                drain(terminal)
                wait_s = REPEAT_S

    hand = threading.Thread(target=type_keys, daemon=True)
    hand.start()
    try:
        yield
    finally:
        released.set()
        hand.join()


def drain(terminal: "pexpect.spawn[str]") -> None:
    """Drop the program's output: a terminal that is not read stops its writer."""
    with suppress(pexpect.TIMEOUT, pexpect.EOF, ValueError):
        while terminal.read_nonblocking(65536, timeout=0):
            pass
