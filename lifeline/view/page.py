"""The page of Rerun's web viewer, served to browsers on this machine alone.

Rerun's own page loads a font from Google and reports its use to Rerun's servers; only the native viewer has a setting
against that. This page is served with a policy that makes the browser refuse every connection except those to this
page and to the view's data.
"""

import threading
from collections.abc import Mapping
from contextlib import closing
from http import HTTPStatus
from http.client import HTTPConnection
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import NamedTuple
from urllib.parse import quote, urlsplit

LOOPBACK = "127.0.0.1"
FETCH_LIMIT_S = 20.0
FILES = ("/", "/re_viewer.js", "/re_viewer_bg.wasm", "/favicon.ico", "/favicon.svg", "/sw.js")


class File(NamedTuple):
    """One file of the page."""

    content_type: str
    content: bytes


def fetch(port: int) -> dict[str, File]:
    """Return the files of the page that Rerun serves on a port of this machine, by path, except those that it lacks.

    Raises:
        OSError, HTTPException: it does not answer.
    """
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
