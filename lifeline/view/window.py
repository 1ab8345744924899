"""Rerun's viewer as a separate process: on loopback only, and without analytics."""

import json
import os
import socket
import subprocess
import time
from contextlib import suppress
from http.client import HTTPException
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

from deploy.stack.errors import DeployError
from lifeline.view.page import LOOPBACK, File, fetch

START_LIMIT_S = 20.0
POLL_S = 0.05
END_LIMIT_S = 0.1
PROXIES = ("HTTPS_PROXY", "HTTP_PROXY", "ALL_PROXY")
NO_PROXY = f"http://{LOOPBACK}:9"
"""The discard port, at which nothing listens."""
DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY")


class Viewer:
    """A viewer process, which ends with `close`.

    Args:
        arguments: of the command `rerun`.
    """

    def __init__(self, *arguments: str) -> None:
        self._home = TemporaryDirectory(prefix="lifeline-view-")
        self._process = subprocess.Popen(
            [str(program()), *arguments, "--bind", LOOPBACK],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            env=os.environ | silent(Path(self._home.name)),
        )

    @property
    def has_ended(self) -> bool:
        return self._process.poll() is not None

    def close(self) -> None:
        """End the process, and remove its files; may be called again."""
        self._process.terminate()
        try:
            self._process.wait(END_LIMIT_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        with suppress(OSError):
            self._home.cleanup()


def program() -> Path:
    """Return the path of the command `rerun` in this environment.

    Raises:
        DeployError: there is none.
    """
    spec = find_spec("rerun_cli")
    place = None if spec is None or spec.origin is None else Path(spec.origin).with_name("rerun")
    if place is None or not place.is_file():
        raise DeployError("the package rerun-sdk has no viewer: install it again, or use --out FILE.rrd")
    return place


def silent(home: Path) -> dict[str, str]:
    """Return the environment in which the viewer connects to no other host.

    Its configuration below `home` disables analytics; there is no option for this. It also asks rerun.io for a list of
    examples, which a proxy that does not exist prevents. The user's own configuration is neither read nor changed.
    """
    folder = home / "rerun"
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / "analytics.json"
    settings: dict[str, object] = {
        "analytics_enabled": False,
        "analytics_id": "",
        "metadata": {},
        "config_file_path": str(file),
        "data_dir_path": str(home / "analytics"),
    }
    file.write_text(json.dumps(settings))
    proxies = {name: NO_PROXY for upper in PROXIES for name in (upper, upper.lower())}
    ours = {"NO_PROXY": "127.0.0.1,localhost", "no_proxy": "127.0.0.1,localhost"}
    return {"XDG_CONFIG_HOME": str(home), "RUST_LOG": os.environ.get("RUST_LOG", "error"), **proxies, **ours}


def check_display() -> None:
    """Check that a window can be opened.

    Raises:
        DeployError: there is no display.
    """
    if not any(os.environ.get(name) for name in DISPLAYS):
        raise DeployError(
            "there is no display here: use --web and a browser, or --out FILE.rrd (docs/how-to/view.md)"
        )


def open_window(data_address: str) -> Viewer:
    """Open the viewer's window for the data at an address."""
    return Viewer(data_address, "--port", "auto", "--hide-welcome-screen")


def serve_page(port: int, data_address: str) -> Viewer:
    """Start Rerun's own server of the web page on a port of this machine."""
    return Viewer("--serve-web", "--web-viewer-port", str(port), data_address)


def files_of(server: Viewer, port: int) -> dict[str, File]:
    """Return the files of the page that a server serves.

    Raises:
        DeployError: it does not answer.
    """
    end_s = time.monotonic() + START_LIMIT_S
    while time.monotonic() < end_s and not server.has_ended:
        with suppress(OSError, HTTPException):
            return fetch(port)
        time.sleep(POLL_S)
    raise DeployError("Rerun's web viewer did not start: use --out FILE.rrd")


def free_port() -> int:
    """Return a port of this machine that is free at present."""
    with socket.socket() as found:
        found.bind((LOOPBACK, 0))
        return int(found.getsockname()[1])


def check_port(port: int) -> None:
    """Check that a port of this machine is free.

    Raises:
        DeployError: it is not.
    """
    with socket.socket() as found:
        found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            found.bind((LOOPBACK, port))
        except OSError as error:
            raise DeployError(
                f"port {port} is in use by another program ({error.strerror}): choose another with --port"
            ) from error
