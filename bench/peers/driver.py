"""Sends commands through a relay and prints how long each one took: `python -m bench.peers.driver LINK ADDRESS RATE_HZ COUNT …`.

Each command has a turning speed of its own, by which it is recognized. The commands are sent at a fixed rate, whether or
not the previous ones have arrived. Prints one line of JSON for each pair of a rate and a count: a list of times in ms; a
command that was not heard within the limit is missing.
"""

import argparse
import json
import os
import sys
import threading
import time

from bench.peers.links import link_of
from bench.peers.links.payload import payload_of, turn_of

PROBE_RAD_S = 0.05
FIRST_RAD_S, STEP_RAD_S = 0.1, 1e-4
KEEP_HZ = 20.0
NEUTRAL_S, PROBE_S, START_LIMIT_S, LIMIT_S = 0.4, 0.3, 30.0, 0.5


class Driver:
    """Sends by one link, and notes when each turning speed was first heard."""

    def __init__(self, link: str, address: str) -> None:
        self._heard_ns: dict[float, int] = {}
        self._changed = threading.Condition()
        self._send = link_of(link).connect(address, "driver", self._hear)

    def _hear(self, message: bytes) -> None:
        at_ns = time.monotonic_ns()
        with self._changed:
            self._heard_ns.setdefault(turn_of(message), at_ns)
            self._changed.notify_all()

    def start(self) -> None:
        """Alternate neutral and a probe until the probe returns; a supervisor requires neutral first.

        Raises:
            TimeoutError: nothing returns.
        """
        deadline_s = time.monotonic() + START_LIMIT_S
        while time.monotonic() < deadline_s:
            for turn_rad_s, duration_s in ((0.0, NEUTRAL_S), (PROBE_RAD_S, PROBE_S)):
                end_s = time.monotonic() + duration_s
                while time.monotonic() < end_s:
                    self._send(payload_of(turn_rad_s))
                    time.sleep(1.0 / KEEP_HZ)
            if PROBE_RAD_S in self._heard_ns:
                return
        raise TimeoutError("nothing returns from the relay")

    def times_ms(self, rate_hz: float, count: int) -> list[float]:
        """Send a number of commands at a rate, and return the time of each one that was heard [ms]."""
        self._heard_ns.clear()
        sent_ns: dict[float, int] = {}
        next_s = time.monotonic()
        for number in range(count):
            turn_rad_s = FIRST_RAD_S + number * STEP_RAD_S
            sent_ns[turn_rad_s] = time.monotonic_ns()
            self._send(payload_of(turn_rad_s))
            next_s += 1.0 / rate_hz
            time.sleep(max(0.0, next_s - time.monotonic()))
        with self._changed:
            self._changed.wait_for(lambda: sent_ns.keys() <= self._heard_ns.keys(), LIMIT_S)
            return [
                (self._heard_ns[turn] - at_ns) / 1e6
                for turn, at_ns in sent_ns.items()
                if turn in self._heard_ns
            ]


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m bench.peers.driver", description=__doc__)
    parser.add_argument("link")
    parser.add_argument("address")
    parser.add_argument("pairs", nargs="+", type=float, metavar="RATE_HZ COUNT")
    options = parser.parse_args()
    driver = Driver(options.link, options.address)
    driver.start()
    for rate_hz, count in zip(options.pairs[::2], options.pairs[1::2], strict=True):
        print(json.dumps(driver.times_ms(rate_hz, round(count))))
    sys.stdout.flush()
    # The links stay open: Zenoh may crash or hang if the interpreter ends while a session is open.
    os._exit(0)


if __name__ == "__main__":
    main()
