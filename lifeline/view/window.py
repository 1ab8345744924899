"""Rerun's viewer as a separate process: on loopback only, and without analytics.

Rerun's own page of the web viewer loads a font from Google and reports its use to Rerun's servers; only the native viewer has
a setting against that. The page is therefore served here, with a policy that makes the browser refuse every connection except
those to this page and to the view's data.
"""

import json
import os
import socket
import subprocess
import threading
import time
from collections.abc import Mapping
from contextlib import closing, suppress
from http import HTTPStatus
from http.client import HTTPConnection, HTTPException
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple
from urllib.parse import quote, urlsplit

from deploy.stack.errors import DeployError

LOOPBACK = "127.0.0.1"
FETCH_LIMIT_S = 20.0
FILES = ("/", "/re_viewer.js", "/re_viewer_bg.wasm", "/favicon.ico", "/favicon.svg", "/sw.js")


class File(NamedTuple):
    """One file of the page."""

    content_type: str
    content: bytes


def _fetch(port: int) -> dict[str, File]:
    """Return the files of the page that Rerun serves on a port of this machine, by path; missing files are left out."""
    files: dict[str, File] = {}
    for path in FILES:
        with closing(HTTPConnection(LOOPBACK, port, timeout=FETCH_LIMIT_S)) as connection:
            connection.request("GET", path)
            reply = connection.getresponse()
            if reply.status == HTTPStatus.OK:
                files[path] = File(reply.headers.get_content_type(), reply.read())
    return files


def policy(data_port: int) -> str:
    """Return the policy (Content-Security-Policy) of a page whose data are served on a port of this machine."""
    data = f"http://{LOOPBACK}:{data_port} http://localhost:{data_port}"
    return (
        "default-src 'none'; script-src 'self' 'unsafe-inline' 'wasm-unsafe-eval' blob:; style-src 'self' 'unsafe-inline'; "
        f"img-src 'self' data: blob:; worker-src 'self' blob:; connect-src 'self' {data}"
    )


def serve(files: Mapping[str, File], port: int, data_address: str) -> str:
    """Serve the page on a daemon thread; return its address.

    Args:
        files: the page's files by path.
        port: a port of this machine.
        data_address: what the page shows: rerun+http://127.0.0.1:PORT/proxy.

    Raises:
        OSError: the port is in use.
    """
    data_port = urlsplit(data_address).port or 0
    with_data = f"/?url={quote(data_address, safe='')}"

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            place = urlsplit(self.path)
            file = files.get(place.path)
            if place.path == "/" and "url=" not in place.query:
                self.send_response(HTTPStatus.FOUND)
                self.send_header("Location", with_data)
                self.send_header("Content-Length", "0")
                self.end_headers()
            elif file is None:
                self.send_error(HTTPStatus.NOT_FOUND)
            else:
                self.send_response(HTTPStatus.OK)
                self.send_header("Content-Type", file.content_type)
                self.send_header("Content-Length", str(len(file.content)))
                self.send_header("Content-Security-Policy", policy(data_port))
                self.end_headers()
                self.wfile.write(file.content)

        def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - as http.server names it
            """Print nothing."""

    server = ThreadingHTTPServer((LOOPBACK, port), Handler)
    threading.Thread(target=server.serve_forever, daemon=True, name="page").start()
    return f"http://{LOOPBACK}:{server.server_port}"


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


def files_of(server: Viewer, port: int) -> dict[str, File]:
    """Return the files of the page that a server serves.

    Raises:
        DeployError: it does not answer.
    """
    end_s = time.monotonic() + START_LIMIT_S
    while time.monotonic() < end_s and not server.has_ended:
        with suppress(OSError, HTTPException):
            return _fetch(port)
        time.sleep(POLL_S)
    raise DeployError("Rerun's web viewer did not start: use --out FILE.rrd")


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
