"""Carries the packets of a pair of namespaces: `python -m bench.link.relay A_FD B_FD`, started by bench/link/rig.py.

The first line of the standard input is JSON: the paths by number, and the seed. Each further line is a command:

    lose      begin to lose and reorder packets
    cut       let no packet pass
    mend      let packets pass again
    end       print counts and lateness as a line of JSON, and end

At the end of the input, the program ends at once: the process that started it is dead.
"""

import argparse
import gc
import json
import os
import select
import sys
import time
from contextlib import suppress
from dataclasses import asdict

from bench.link.conditions import Path
from bench.link.lateness import Lateness
from bench.link.router import Router

LARGEST = 2048
TURN = 64
"""Maximum number of packets that are read before due packets leave."""
STDIN = 0


def relay(router: Router, fds: tuple[int, int]) -> Lateness:
    """Carry packets until the input says `end`; return how late they left."""
    late = Lateness()
    typed = b""
    while True:
        for due_s, _, to, packet in router.due(time.monotonic()):
            with suppress(OSError):  # a full device loses the packet, as a full queue does
                os.write(fds[to], packet)
            late.add(due_s, time.monotonic())
        next_s = router.next_s
        wait_s = None if next_s is None else max(0.0, next_s - time.monotonic())
        ready, _, _ = select.select([STDIN, *fds], [], [], wait_s)
        for side in (0, 1):
            if fds[side] in ready:
                _read(router, fds[side], 1 - side)
        if STDIN in ready:
            read = os.read(STDIN, 4096)
            if not read:
                os._exit(1)
            *lines, typed = (typed + read).split(b"\n")
            for line in lines:
                if line == b"end":
                    return late
                _obey(router, line)


def _read(router: Router, fd: int, to: int) -> None:
    for _ in range(TURN):
        try:
            packet = os.read(fd, LARGEST)
        except BlockingIOError:
            return
        router.take(packet, to, time.monotonic())


def _obey(router: Router, line: bytes) -> None:
    match line:
        case b"lose":
            router.is_calm = False
        case b"cut":
            router.is_cut = True
        case b"mend":
            router.is_cut = False
        case _:
            raise ValueError(f"not a command of the relay: {line!r}")
    print("done", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m bench.link.relay", description=__doc__)
    parser.add_argument("fds", type=int, nargs=2)
    fds: tuple[int, int] = tuple(parser.parse_args().fds)
    given = json.loads(_first_line())
    router = Router({int(number): Path(*path) for number, path in given["paths"].items()}, given["seed"])
    router.is_calm = True
    with suppress(PermissionError):  # then the bench reports how late it is
        # Above the flows, which may have real-time priority as well.
        priority = os.sched_getparam(0).sched_priority + 1
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(priority))
    gc.freeze()
    gc.disable()  # a collection would delay all packets
    print("ready", flush=True)
    late = relay(router, fds)
    print(json.dumps({"counts": asdict(router.counts), "late": late.report()}), flush=True)
    sys.stdout.close()


def _first_line() -> bytes:
    """Read one line without a buffer, because `select` does not see what waits in a buffer."""
    line = bytearray()
    while not line.endswith(b"\n"):
        one = os.read(STDIN, 1)
        if not one:
            os._exit(1)
        line += one
    return bytes(line)


if __name__ == "__main__":
    main()
