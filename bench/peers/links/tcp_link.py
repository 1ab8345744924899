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


def _serve(address: str, talk: Callable[[socket.socket], None]) -> None:
    """Listen, and let a thread talk to one peer after another."""
    server = socket.create_server(_host_and_port(address))

    def serve() -> None:
        while True:
            talk(server.accept()[0])

    threading.Thread(target=serve, daemon=True).start()


def connect(address: str, role: str, heard: Callable[[bytes], None]) -> Callable[[bytes], None]:
    """Connect the driver, or listen for it as the relay; the relay's `send` needs a connected driver."""
    if role == "driver":
        stream = socket.create_connection(_host_and_port(address))
        threading.Thread(target=_frames, args=(stream, heard), daemon=True).start()
        return stream.sendall
    streams: list[socket.socket] = []

    def talk(stream: socket.socket) -> None:
        streams[:] = [stream]
        _frames(stream, heard)

    _serve(address, talk)

    def send(payload: bytes) -> None:
        streams[0].sendall(payload)

    return send


def hold(address: str) -> None:
    _kept.append(socket.create_connection(_host_and_port(address)))


def watch(address: str, lost: Callable[[], None]) -> None:
    """Listen for one holder after another."""

    def talk(stream: socket.socket) -> None:
        _frames(stream, lambda _: None)
        lost()

    _serve(address, talk)
