"""The processes that are compared: `python -m bench.peers.programs PROGRAM LINK ADDRESS …`.

    relay callback|asyncio    pass each message on: on the transport's own thread, or in an event loop, as the supervisor does
    driver RATE_HZ COUNT …    send commands through a relay, and print how long each one took: a line of JSON for each pair
    holder                    be present until killed; print a line when connected
    watcher                   print a line when it watches, and then the time of each loss of a holder, by CLOCK_MONOTONIC [ns]

Times of two processes of one machine can be compared.
"""

import asyncio
import json
import os
import sys
import threading
import time
from collections import deque
from collections.abc import Callable

from bench.peers.links import link_of, payload_of, turn_of

PROBE_RAD_S = 0.05
FIRST_RAD_S, STEP_RAD_S = 0.1, 1e-4
KEEP_HZ = 20.0
NEUTRAL_S, PROBE_S, START_LIMIT_S, LIMIT_S = 0.4, 0.3, 30.0, 0.5

Send = Callable[[bytes], None]


def relay(link: str, address: str, mode: str) -> None:
    if mode == "callback":
        _relay_in_callback(link, address)
    else:
        asyncio.run(_relay_in_loop(link, address))


def _relay_in_callback(link: str, address: str) -> None:
    ready, send = threading.Event(), list[Send]()

    def heard(payload: bytes) -> None:
        ready.wait()
        send[0](payload)

    send.append(link_of(link).connect(address, "relay", heard))
    ready.set()
    threading.Event().wait()


async def _relay_in_loop(link: str, address: str) -> None:
    loop, wake, waiting = asyncio.get_running_loop(), asyncio.Event(), deque[bytes]()

    def heard(payload: bytes) -> None:
        waiting.append(payload)
        loop.call_soon_threadsafe(wake.set)

    send = link_of(link).connect(address, "relay", heard)
    while True:
        await wake.wait()
        wake.clear()
        while waiting:
            send(waiting.popleft())


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
        """Send a number of commands at a rate, whether or not the previous ones have arrived.

        Each has a turning speed of its own, by which it is recognized.

        Returns:
            The time of each one that was heard within the limit [ms].
        """
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
            heard = [turn for turn in sent_ns if turn in self._heard_ns]
            return [(self._heard_ns[turn] - sent_ns[turn]) / 1e6 for turn in heard]


def drive(link: str, address: str, *pairs: str) -> None:
    driver = Driver(link, address)
    driver.start()
    for rate_hz, count in zip(pairs[::2], pairs[1::2], strict=True):
        print(json.dumps(driver.times_ms(float(rate_hz), int(count))))
    sys.stdout.flush()
    # The links stay open: Zenoh may crash or hang if the interpreter ends while a session is open.
    os._exit(0)


def hold(link: str, address: str) -> None:
    link_of(link).hold(address)
    print("present", flush=True)
    threading.Event().wait()


def watch(link: str, address: str) -> None:
    link_of(link).watch(address, lambda: print(time.monotonic_ns(), flush=True))
    print("watching", flush=True)
    threading.Event().wait()


PROGRAMS: dict[str, Callable[..., None]] = {
    "relay": relay,
    "driver": drive,
    "holder": hold,
    "watcher": watch,
}

if __name__ == "__main__":
    PROGRAMS[sys.argv[1]](*sys.argv[2:])
