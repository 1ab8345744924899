"""The supervisor in the place of a relay: a command source and a reader of `cmd_vel`; `bench.rig.feed` provides its sensors."""

import asyncio
import os
import threading
import time
from collections.abc import Callable
from itertools import count
from pathlib import Path

from bench.peers.links import CDR_HEADER, payload_of, turn_of
from wire import topics
from wire.bus_config import BusConfig
from wire.stamp import GID_BYTES, Stamp
from wire.zenoh.connect import open_session
from wire.zenoh.session import ZenohSession

SPEED_RAD_S, PERIOD_S, NEUTRAL_EVERY = 0.3, 0.05, 10
_kept: list[object] = []


def _open(address: str, namespace: str = "robot", keys: Path | None = None) -> ZenohSession:
    """Open a session as a client."""
    config = BusConfig(address, namespace, keys=keys)

    async def opened() -> ZenohSession:
        return ZenohSession(await open_session(config, "client"), config.namespace)

    session = asyncio.run(opened())
    _kept.append(session)
    return session


def _source(session: ZenohSession) -> Callable[[bytes], None]:
    """Return a function that sends a command as the keyboard's source."""
    publisher = session.publisher_raw(topics.source_cmd_vel(topics.TELEOP))
    sequence, gid = count(1), os.urandom(GID_BYTES)

    def send(payload: bytes) -> None:
        publisher.put_bytes(CDR_HEADER + payload, Stamp(next(sequence), time.monotonic_ns(), gid).pack())

    return send


def _hear_cmd_vel(session: ZenohSession, heard: Callable[[bytes], None]) -> None:
    session.subscribe_raw(
        topics.CMD_VEL.key, lambda payload, _attachment, _arrival_s: heard(payload[len(CDR_HEADER) :])
    )


def connect(address: str, role: str, heard: Callable[[bytes], None]) -> Callable[[bytes], None]:
    assert role == "driver", "the supervisor itself is the relay"
    session = _open(address)
    _kept.append(session.declare_alive(topics.TELEOP))
    _hear_cmd_vel(session, heard)
    return _source(session)


def hold(address: str, namespace: str = "robot", keys: Path | None = None) -> None:
    """Command neutral, and then turn the robot until the process is killed; return when it turns."""
    session, turns = _open(address, namespace, keys), threading.Event()
    _kept.append(session.declare_alive(topics.TELEOP))
    send = _source(session)

    def drive() -> None:
        for number in count():
            # The first neutral command may arrive before the sensors do.
            turn_rad_s = SPEED_RAD_S if turns.is_set() or number % NEUTRAL_EVERY else 0.0
            send(payload_of(turn_rad_s))
            time.sleep(PERIOD_S)

    def heard(payload: bytes) -> None:
        if turn_of(payload):
            turns.set()

    _hear_cmd_vel(session, heard)
    threading.Thread(target=drive, daemon=True).start()
    turns.wait()


def watch(address: str, lost: Callable[[], None]) -> None:
    """Call `lost` when the command to the base becomes zero."""
    moved = False

    def heard(payload: bytes) -> None:
        nonlocal moved
        moves = turn_of(payload) != 0.0
        if moved and not moves:
            lost()
        moved = moves

    _hear_cmd_vel(_open(address), heard)
