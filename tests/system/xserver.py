"""An X server without a screen (Xvfb), its picture, and a click that closes windows."""

import ctypes
import ctypes.util
import os
import shutil
import struct
import subprocess
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

WIDTH, HEIGHT = 1000, 720
XVFB = shutil.which("Xvfb")


@dataclass
class XServer:
    """A running Xvfb."""

    display: str
    _frame: Path

    def screen(self) -> NDArray[np.uint8]:
        """Return the present picture, RGB, shape (height, width, 3): its file is an XWD dump that it keeps up to date."""
        data = self._frame.read_bytes()
        fields = struct.unpack(">25I", data[:100])
        header_size, width, height, line_bytes, colours = (fields[n] for n in (0, 4, 5, 12, 19))
        pixels = np.frombuffer(data, np.uint8, height * line_bytes, header_size + 12 * colours)
        return pixels.reshape(height, line_bytes)[:, : 4 * width].reshape(height, width, 4)[:, :, 2::-1]

    def close_windows(self) -> None:
        """Close all windows, like a click on the X in their corners."""
        x11 = ctypes.CDLL(ctypes.util.find_library("X11"))
        for name in ("XOpenDisplay", "XDefaultRootWindow", "XInternAtom"):
            getattr(x11, name).restype = ctypes.c_void_p if name == "XOpenDisplay" else ctypes.c_ulong
        display = ctypes.c_void_p(x11.XOpenDisplay(self.display.encode()))
        root, parent, count = ctypes.c_ulong(), ctypes.c_ulong(), ctypes.c_uint()
        children = ctypes.POINTER(ctypes.c_ulong)()
        x11.XQueryTree(
            display,
            ctypes.c_ulong(x11.XDefaultRootWindow(display)),
            *map(ctypes.byref, (root, parent, children, count)),
        )
        protocols, delete = (
            x11.XInternAtom(display, name, 0) for name in (b"WM_PROTOCOLS", b"WM_DELETE_WINDOW")
        )
        for window in children[: count.value]:
            # struct XClientMessageEvent of a 64-bit machine, padded to an XEvent.
            event = struct.pack(
                "=iiqiiqqqiiqqqqq", 33, 0, 0, 1, 0, 0, window, protocols, 32, 0, delete, 0, 0, 0, 0
            )
            x11.XSendEvent(display, ctypes.c_ulong(window), 0, ctypes.c_long(0), event.ljust(192, b"\0"))
        x11.XCloseDisplay(display)


@contextmanager
def x_server(directory: Path) -> Generator[XServer]:
    """Run an Xvfb for the duration of the block."""
    assert XVFB is not None
    reading, writing = os.pipe()
    server = subprocess.Popen(
        [
            XVFB,
            *("-displayfd", str(writing), "-screen", "0", f"{WIDTH}x{HEIGHT}x24"),
            *("-fbdir", str(directory), "-nolisten", "tcp"),
        ],
        pass_fds=(writing,),
        stderr=subprocess.DEVNULL,
    )
    os.close(writing)
    try:
        with os.fdopen(reading) as said:
            number = said.readline().strip()
        assert number, "Xvfb did not start"
        yield XServer(f":{number}", directory / "Xvfb_screen0")
    finally:
        server.terminate()
        server.wait(10)
