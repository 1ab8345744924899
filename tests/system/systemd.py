"""What systemd does for a service: it reads the unit, starts the process with its variables, and receives its reports."""

import os
import select
import shlex
import signal
import socket
import subprocess
import time
from pathlib import Path

from tests.system.harness import PATIENCE_S

READY, RUNNING, STOPPING = b"READY=1\nWATCHDOG=1", b"WATCHDOG=1", b"STOPPING=1"


def end(process: "subprocess.Popen[bytes]") -> None:
    """End a service, also a stopped one."""
    process.send_signal(signal.SIGCONT)
    process.terminate()
    try:
        process.wait(PATIENCE_S)
    except subprocess.TimeoutExpired:
        process.kill()


class Systemd:
    """The socket on which systemd listens."""

    def __init__(self, name: str) -> None:
        self.name = name
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind(name.replace("@", "\0"))

    def next(self, within_s: float) -> bytes | None:
        """Return the next report; None if there is none in time."""
        return self._socket.recv(4096) if select.select([self._socket], [], [], within_s)[0] else None

    def await_ready(self) -> None:
        assert self.next(PATIENCE_S) == READY

    def times_of(self, number: int) -> list[float]:
        """Return when each of the next reports of a running loop arrives, by the monotonic clock [s]."""
        times: list[float] = []
        for _ in range(number):
            assert self.next(PATIENCE_S) == RUNNING
            times.append(time.monotonic())
        return times

    def all_until_silent(self, silent_s: float) -> list[bytes]:
        reports: list[bytes] = []
        while (report := self.next(silent_s)) is not None:
            reports.append(report)
        return reports

    def close(self) -> None:
        self._socket.close()


class Unit:
    """A unit of deploy/systemd, for an installation at other paths.

    Args:
        path: the file.
        places: each directory in the file, and what takes its place.
    """

    def __init__(self, path: Path, places: dict[str, str]) -> None:
        self.text = path.read_text()
        for place, other in places.items():
            self.text = self.text.replace(place, other)
        self._settings: dict[str, list[str]] = {}
        for line in self.text.splitlines():
            name, separator, value = line.partition("=")
            if separator and not line.startswith("#"):
                self._settings.setdefault(name, []).append(value)

    def __getitem__(self, name: str) -> str:
        """Return the only value of a setting."""
        (value,) = self._settings[name]
        return value

    @property
    def command(self) -> list[str]:
        return shlex.split(self["ExecStart"])

    def seconds(self, name: str) -> float:
        value = self[name]
        return (
            float(value.removesuffix("ms")) / 1000.0
            if value.endswith("ms")
            else float(value.removesuffix("s"))
        )

    def variables(self, socket_name: str) -> dict[str, str]:
        """Return the environment of the process, with the socket for its reports."""
        set_here = dict(word.split("=", 1) for word in shlex.split(self["Environment"]))
        watchdog_us = str(round(self.seconds("WatchdogSec") * 1e6))
        return os.environ | set_here | {"NOTIFY_SOCKET": socket_name, "WATCHDOG_USEC": watchdog_us}
