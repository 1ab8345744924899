"""Starts operators for `bench.robots` to kill: `python -m bench.robots.holders`.

Each line `NUMBER ENDPOINT NAMESPACE`, optionally followed by a bundle, on the standard input starts an operator, a process that drives
the robot at this endpoint. Prints `started NUMBER PID`, and `driving NUMBER PID` when the robot moves. The processes are forks of
this one, which has imported all modules and opened no session: starting a new interpreter for each of them would load the machine.
"""

import os
import signal
import sys
import threading
from pathlib import Path

from bench.peers.links import lifeline_link
from bench.rig.program import die_with_parent


def main() -> None:
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # the kernel reaps the children
    for line in sys.stdin:
        number, endpoint, namespace, *keys = line.split()
        pid = os.fork()
        if pid == 0:
            die_with_parent()
            lifeline_link.hold(endpoint, namespace, Path(keys[0]) if keys else None)
            _tell(f"driving {number} {os.getpid()}")
            threading.Event().wait()
        _tell(f"started {number} {pid}")


def _tell(text: str) -> None:
    """Print a line in one write: several processes share the pipe."""
    os.write(1, f"{text}\n".encode())


if __name__ == "__main__":
    main()
