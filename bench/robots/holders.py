"""Starts operators for `bench.robots` to kill: `python -m bench.robots.holders`.

Each line `NUMBER ENDPOINT` or `NUMBER ENDPOINT NAMESPACE KEYS` on the standard input starts an operator, a process that drives
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
        number, endpoint, *reach = line.split()
        pid = os.fork()
        if pid == 0:
            die_with_parent()
            namespace, keys = (reach[0], Path(reach[1])) if reach else ("robot", None)
            lifeline_link.hold(endpoint, namespace, keys)
            _tell(f"driving {number} {os.getpid()}")
            threading.Event().wait()
        _tell(f"started {number} {pid}")


def _tell(text: str) -> None:
    """Print a line in one write: several processes share the pipe."""
    os.write(1, f"{text}\n".encode())


if __name__ == "__main__":
    main()
