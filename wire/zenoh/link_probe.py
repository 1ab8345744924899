"""Try once to connect to a supervisor, with Zenoh's log on standard output.

`python -m wire.zenoh.link_probe ENDPOINT NAMESPACE KEYS`: a client starts it to find out why it cannot connect (zenoh_log.py).
"""

import sys
from pathlib import Path

from wire.bus_config import BusConfig
from wire.zenoh.connect import try_once


def main() -> None:
    endpoint, namespace, keys = sys.argv[1:]
    try_once(BusConfig(endpoint, namespace, keys=Path(keys)))


if __name__ == "__main__":
    main()
