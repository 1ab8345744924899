"""A student's keyboard teleop over Zenoh, as small as it can be: `python student_teleop.py ENDPOINT [--guard | --patrol]`.

w adds 0.1 m/s, s stops. It repeats its velocity at random times, also zero: two instances fight. With --guard, it starts a process that
sends zero as soon as this one is gone. With --patrol, it begins late, needs no keys, and drives and rests in turns, whatever is ahead.
"""

import json
import os
import random
import select
import subprocess
import sys
import termios
import time
import tty

import zenoh

from wire import topics
from wire.bus_config import BusConfig
from wire.cdr import STANDSTILL, Planar, twist

KEY = f"{BusConfig().namespace}/{topics.CMD_VEL.key}"
PERIOD_S = (0.1, 0.5)
LEG_S, REST_S, LATE_S = 4.0, 1.8, 5.0


def connected(endpoint: str) -> zenoh.Session:
    config = zenoh.Config()
    for key, value in (
        ("mode", "client"),
        ("connect/endpoints", [endpoint]),
        ("scouting/multicast/enabled", False),
    ):
        config.insert_json5(key, json.dumps(value))
    return zenoh.open(config)


def guard(endpoint: str) -> None:
    """Wait for the end of the teleop, and then stop the robot."""
    session = connected(endpoint)
    print("ready", flush=True)
    sys.stdin.read()
    session.put(KEY, twist(STANDSTILL))
    session.close()


def drive(endpoint: str) -> None:
    session = connected(endpoint)
    speed_m_s = 0.0
    tty.setcbreak(sys.stdin.fileno(), termios.TCSANOW)
    print("w: faster, s: stop", flush=True)
    while True:
        ready, _, _ = select.select([sys.stdin], [], [], random.uniform(*PERIOD_S))
        for key in os.read(sys.stdin.fileno(), 64) if ready else b"":
            if key == ord("w"):
                speed_m_s = min(1.0, speed_m_s + 0.1)
            elif key == ord("s"):
                speed_m_s = 0.0
        session.put(KEY, twist(Planar(speed_m_s, 0.0)))


def patrol(endpoint: str) -> None:
    time.sleep(LATE_S)
    session = connected(endpoint)
    print("patrols", flush=True)
    while True:
        for number in range(round((LEG_S + REST_S) / PERIOD_S[0])):
            session.put(KEY, twist(Planar(0.3 if number * PERIOD_S[0] < LEG_S else 0.0, 0.0)))
            time.sleep(PERIOD_S[0])


def main() -> None:
    endpoint, *options = sys.argv[1:]
    if "--guarding" in options:
        return guard(endpoint)
    if "--patrol" in options:
        return patrol(endpoint)
    if "--guard" in options:
        command = [sys.executable, __file__, endpoint, "--guarding"]
        watching = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        assert watching.stdout is not None
        watching.stdout.readline()
    return drive(endpoint)


if __name__ == "__main__":
    main()
