"""A Zenoh router with the settings of rmw_zenohd; it ends when stdin is closed."""

import argparse
import json
import threading

import zenoh

from tests.ros2.peers.lines import READY, listen, say


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--listen", required=True, metavar="ENDPOINT")
    options = parser.parse_args()
    settings = zenoh.Config()
    for key, value in {
        "mode": "router",
        "listen/endpoints": [options.listen],
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": True,
    }.items():
        settings.insert_json5(key, json.dumps(value))
    session = zenoh.open(settings)
    ended = threading.Event()
    listen(lambda _: None, ended.set)
    say(**{READY: options.listen})
    ended.wait()
    session.close()


if __name__ == "__main__":
    main()
