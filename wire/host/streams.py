"""Replaces standard streams that were closed before the start, so that no socket or file gets their descriptors."""

import os
import sys


def open_closed_streams() -> None:
    """Open /dev/null in place of each closed standard stream; call this before anything else is opened."""
    for descriptor, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # gets the lowest free number
            os.set_inheritable(descriptor, True)  # noqa: FBT003 - the only argument beside it
        if getattr(sys, name) is None:
            mode = "r" if name == "stdin" else "w"
            setattr(sys, name, os.fdopen(descriptor, mode, encoding="utf-8", closefd=False))
