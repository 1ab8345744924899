"""A child process that stands for a ROS 2 program: its DDS identity, and the signals that stop and continue it."""

import os
import signal
import subprocess

from ros2 import guard

HOST = b"\x12\x34"
LIMIT_S = 20.0
"""Time limit for expected events on a loaded machine."""

Child = subprocess.Popen[bytes]


def gid_of(pid: int, entity: int = 0, host: bytes = HOST) -> bytes:
    """Return the identity that Fast DDS gives to an endpoint of a process."""
    return guard.EPROSIMA + host + (pid & 0xFFFF).to_bytes(2, "little") + bytes(9) + bytes([entity])


OWN_GID = gid_of(os.getpid())


def stop(child: Child) -> None:
    """Stop a child process, and wait until it has stopped."""
    child.send_signal(signal.SIGSTOP)
    os.waitid(os.P_PID, child.pid, os.WSTOPPED | os.WNOWAIT)


def go_on(child: Child) -> None:
    """Continue a child process, and wait until it has continued."""
    child.send_signal(signal.SIGCONT)
    os.waitid(os.P_PID, child.pid, os.WCONTINUED | os.WNOWAIT)
