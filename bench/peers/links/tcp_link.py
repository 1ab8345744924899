"""Raw TCP with asyncio in the relay and a thread in the driver; frames of fixed size. The end of the stream shows an end."""

import socket
import threading
from collections.abc import Callable

from bench.peers.links import PAYLOAD_BYTES

_kept: list[object] = []


def _host_and_port(address: str) -> tuple[str, int]:
    host, _, port = address.removeprefix("tcp/").rpartition(":")
    return host, int(port)


def _frames(stream: socket.socket, heard: Callable[[bytes], None]) -> None:
    """Call `heard` with each frame until the stream ends."""
    stream.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    buffer = b""
    while chunk := stream.recv(4096):
        buffer += chunk
        while len(buffer) >= PAYLOAD_BYTES:
            heard(buffer[:PAYLOAD_BYTES])
            buffer = buffer[PAYLOAD_BYTES:]


def connect(address: str, role: str, heard: Callable[[bytes], None]) -> Callable[[bytes], None]:
    """Connect the driver, or listen for it as the relay; the relay's `send` needs a connected driver."""
    if role == "driver":
        stream = socket.create_connection(_host_and_port(address))
        threading.Thread(target=_frames, args=(stream, heard), daemon=True).start()
        return stream.sendall
    server = socket.create_server(_host_and_port(address))
    streams: list[socket.socket] = []

    def serve() -> None:
        while True:
            stream, _ = server.accept()
            streams[:] = [stream]
            _frames(stream, heard)

    threading.Thread(target=serve, daemon=True).start()

    def send(payload: bytes) -> None:
        streams[0].sendall(payload)

    return send


def hold(address: str) -> None:
    _kept.append(socket.create_connection(_host_and_port(address)))


def watch(address: str, lost: Callable[[], None]) -> None:
    """Listen for one holder after another."""
    server = socket.create_server(_host_and_port(address))

    def serve() -> None:
        while True:
            stream, _ = server.accept()
            _frames(stream, lambda _: None)
            lost()

    threading.Thread(target=serve, daemon=True).start()
