"""Is present until it is killed: `python -m bench.peers.holder LINK ADDRESS`; it prints a line when it is connected."""

import sys
import threading
from importlib import import_module


def main() -> None:
    link, address = sys.argv[1:]
    import_module(f"bench.peers.links.{link}_link").hold(address)
    print("present", flush=True)
    threading.Event().wait()


if __name__ == "__main__":
    main()
