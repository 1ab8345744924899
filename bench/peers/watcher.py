"""Prints the time of each loss of a holder: `python -m bench.peers.watcher LINK ADDRESS`, by CLOCK_MONOTONIC in ns.

The first line is printed when it watches. Times of two processes of one machine can be compared.
"""

import sys
import threading
import time

from bench.peers.links import link_of


def main() -> None:
    link, address = sys.argv[1:]
    link_of(link).watch(address, lambda: print(time.monotonic_ns(), flush=True))
    print("watching", flush=True)
    threading.Event().wait()


if __name__ == "__main__":
    main()
