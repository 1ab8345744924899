"""Is present until it is killed: `python -m bench.peers.holder LINK ADDRESS`; it prints a line when it is connected."""

import sys
import threading

from bench.peers.links import link_of


def main() -> None:
    link, address = sys.argv[1:]
    link_of(link).hold(address)
    print("present", flush=True)
    threading.Event().wait()


if __name__ == "__main__":
    main()
