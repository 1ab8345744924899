"""A network namespace for the whole run, so that no packet leaves this machine."""

import os
import shutil
import subprocess
import sys

INSIDE = "LIFELINE_ISOLATED"
"""The variable that is set inside the namespace."""


def can_isolate() -> bool:
    """Return whether this process may create network namespaces."""
    tools = shutil.which("unshare") and shutil.which("ip")
    return (
        bool(tools)
        and subprocess.run(["unshare", "--net", "true"], check=False, capture_output=True).returncode == 0
    )


def is_isolated() -> bool:
    return INSIDE in os.environ


def isolate() -> None:
    """Replace this process by the same command in a network namespace of its own."""
    again = [sys.executable, "-m", "bench.ros2_crash", *sys.argv[1:]]
    command = ["unshare", "--net", "sh", "-c", 'ip link set lo up && exec "$@"', "sh", *again]
    os.execvpe(command[0], command, os.environ | {INSIDE: "1"})
