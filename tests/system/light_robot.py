"""Sensors and base of one robot, without a simulator: `python -m tests.system.light_robot ENDPOINT NAMESPACE`.

Prints `moves SECONDS` and `zero SECONDS`, by the monotonic clock, when the command to the base begins and ends to move it. It
ends with its standard input.
"""

import asyncio
import sys
import threading

from bench.robots.feeder import Body, encoded_scans, send
from wire.session import BusConfig, ZenohSession, open_session


class Watched(Body):
    """A body that reports each change between motion and standstill."""

    moves = False

    def look(self) -> None:
        """Report what has arrived since the last call; on the thread that sends."""
        for arrival_s, _, moves in self.heard[:]:
            if moves is not self.moves:
                self.moves = moves
                print(f"{'moves' if moves else 'zero'} {arrival_s}", flush=True)
        del self.heard[: len(self.heard) - 1]


def main() -> None:
    endpoint, namespace = sys.argv[1:]
    session = asyncio.run(open_session(BusConfig(endpoint, namespace), "client"))
    body, ended = Watched(ZenohSession(session, namespace), encoded_scans(), lambda: None), threading.Event()

    def wait() -> None:
        sys.stdin.read()
        ended.set()

    threading.Thread(target=wait, daemon=True).start()
    send([*body.acts(), (body.look, 200.0)], ended)


if __name__ == "__main__":
    main()
