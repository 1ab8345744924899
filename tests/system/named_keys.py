"""A hub without access control that publishes on each key the name of the key, every millisecond.

python named_keys.py ENDPOINT KEY...     (until its stdin closes)
"""

import json
import sys
import threading
import time

import zenoh

config = zenoh.Config()
for name, value in {
    "mode": "peer",
    "listen/endpoints": [sys.argv[1]],
    "scouting/multicast/enabled": False,
    "transport/shared_memory/enabled": False,
    "transport/link/tx/lease": 200,
}.items():
    config.insert_json5(name, json.dumps(value))
session = zenoh.open(config)
publishers = [(session.declare_publisher(key, express=True), key) for key in sys.argv[2:]]
ended = threading.Event()
threading.Thread(target=lambda: (sys.stdin.read(), ended.set()), daemon=True).start()
while not ended.is_set():
    for publisher, key in publishers:
        publisher.put(key)
    time.sleep(0.001)
session.close()
