"""Sensors and base of one robot, without a simulator: `python -m tests.system.light_robot ENDPOINT NAMESPACE`.

Prints `moves SECONDS` and `zero SECONDS`, by the monotonic clock, when the command to the base begins and ends to move it. It
ends with its standard input.
"""

import asyncio
import sys
import threading

from bench.rig.feed import Body, encoded_scans, send
from wire.bus_config import BusConfig
from wire.zenoh.connect import open_session
from wire.zenoh.session import ZenohSession


class Watched(Body):
    """A body that reports each change between motion and standstill."""

    moves = False

    def look(self) -> None:
        """Report what has arrived since the last call; on the thread that sends."""
        heard = self.heard[:]
        for arrival_s, _, moves in heard:
            if moves is not self.moves:
                self.moves = moves
                print(f"{'moves' if moves else 'zero'} {arrival_s}", flush=True)
        del self.heard[: len(heard)]


async def connect(endpoint: str, namespace: str) -> ZenohSession:
    return ZenohSession(await open_session(BusConfig(endpoint, namespace), "client"), namespace)


def main() -> None:
    endpoint, namespace = sys.argv[1:]
    body = Watched(asyncio.run(connect(endpoint, namespace)), encoded_scans(), lambda: None)
    ended = threading.Event()

    def wait() -> None:
        sys.stdin.read()
        ended.set()

    threading.Thread(target=wait, daemon=True).start()
    send([*body.acts(), (body.look, 200.0)], ended)


if __name__ == "__main__":
    main()
