"""Zenoh's wire protocol, as far as an attack needs it: a session that breaks rules which Zenoh's library keeps.

Messages and constants: commons/zenoh-protocol of github.com/eclipse-zenoh/zenoh, protocol version 9.
"""

import os
import socket
import struct

_INIT, _OPEN, _FRAME, _FRAGMENT = 0x01, 0x02, 0x05, 0x06
_HAS_SIZES = 0x40
_RELIABLE, _MORE = 0x20, 0x40
_DECLARE = 0x1E
_NAMED = 0x20
KEY_EXPRESSION, SUBSCRIBER, QUERYABLE, TOKEN = 0x00, 0x02, 0x04, 0x06
_VERSION = 9
ROUTER, CLIENT = 0, 2
_ID_BYTES = 16
_SIZES = b"\x0a\xff\xff"
"""Sequence numbers of 32 bits, batches of up to 65,535 bytes."""
_LEASE_MS = 1 << 40
"""The hub would wait 35 years for the next sign of life."""


def connect(endpoint: str) -> socket.socket:
    """Open a TCP connection to an endpoint such as `tcp/127.0.0.1:7447`."""
    host, port = endpoint.removeprefix("tcp/").rsplit(":", maxsplit=1)
    return socket.create_connection((host, int(port)))


def send(link: socket.socket, batch: bytes) -> None:
    link.sendall(struct.pack("<H", len(batch)) + batch)


def introduction(mode: int = CLIENT) -> bytes:
    """Return the first message of a session, with a new random id; a mode is `ROUTER` or `CLIENT`."""
    zid = os.urandom(_ID_BYTES - 1) + b"\x01"
    return bytes([_INIT | _HAS_SIZES, _VERSION, (_ID_BYTES - 1) << 4 | mode]) + zid + _SIZES


def declaration(kind: int, number: int, key: str) -> bytes:
    """Return the declaration of a key expression, subscriber, queryable or token."""
    named = key.encode()
    return bytes([_DECLARE, kind | _NAMED]) + _integer(number) + _integer(0) + _integer(len(named)) + named


class WireSession:
    """An open session that never reads and never ends by its lease."""

    def __init__(self, endpoint: str, mode: int = CLIENT) -> None:
        self._link = connect(endpoint)
        self._sequence = 1
        send(self._link, introduction(mode))
        cookie = _cookie(self._receive())
        opening = _integer(_LEASE_MS) + _integer(self._sequence) + _integer(len(cookie)) + cookie
        send(self._link, bytes([_OPEN]) + opening)
        self._receive()

    def confirm(self) -> None:
        """Wait until the hub sends something, such as a sign of life.

        Raises:
            OSError: it has closed the session.
        """
        if not self._receive():
            raise OSError("the hub has closed the session")

    def close(self) -> None:
        self._link.close()

    def frame(self, messages: bytes) -> None:
        """Send messages; a frame may have up to 40,000 bytes."""
        self._send_next(_FRAME | _RELIABLE, messages)

    def fragment(self, part: bytes) -> None:
        """Send a part of a message that more parts will follow."""
        self._send_next(_FRAGMENT | _RELIABLE | _MORE, part)

    def _send_next(self, header: int, body: bytes) -> None:
        send(self._link, bytes([header]) + _integer(self._sequence) + body)
        self._sequence += 1

    def _receive(self) -> bytes:
        """Return the next batch; empty if the hub has closed the connection."""
        size = self._link.recv(2, socket.MSG_WAITALL)
        return self._link.recv(int.from_bytes(size, "little"), socket.MSG_WAITALL) if size else b""


def _cookie(answer: bytes) -> bytes:
    """Return the cookie in the answer to an introduction."""
    begin = 3 + (answer[2] >> 4) + 1
    if answer[0] & _HAS_SIZES:
        begin += len(_SIZES)
    size = shift = 0
    while True:
        byte = answer[begin]
        size |= (byte & 0x7F) << shift
        begin, shift = begin + 1, shift + 7
        if byte < 0x80:
            return answer[begin : begin + size]


def _integer(value: int) -> bytes:
    """Return an integer with seven bits in each byte, the lowest first."""
    encoded = bytearray()
    while value > 0x7F:
        encoded.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*encoded, value])
