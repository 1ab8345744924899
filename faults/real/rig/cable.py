"""A network namespace for teleop, connected to this machine by a veth pair that can be unplugged.

Unlike the proxy, this uses the kernel's own TCP on a link that is down, with its retransmissions and their
growing intervals. It requires root and `ip` of iproute2.
"""

import os
import shutil
import subprocess
from contextlib import suppress

from deploy.stack.errors import DeployError

COMMAND_LIMIT_S = 10.0


def missing() -> str | None:
    """Return what network namespaces lack on this machine, in one sentence; None if nothing."""
    if os.geteuid() != 0:
        return "network namespaces need root"
    return None if shutil.which("ip") else "network namespaces need `ip` of iproute2"


def why_not() -> str | None:
    """Return why no namespace can be created here, in one sentence; None if it can."""
    reason = missing()
    if reason is not None:
        return reason
    try:
        with_cable = Cable(os.getpid(), subnet=250)
    except DeployError as error:
        return str(error)
    with_cable.close()
    return None


class Cable:
    """A namespace and its cable; it must be closed, because it outlives this process.

    Args:
        number: makes its names unique on this machine.
        subnet: third byte of its addresses, 10.213.SUBNET.0/30.

    Raises:
        DeployError: the kernel refuses; nothing is left behind.
    """

    def __init__(self, number: int, *, subnet: int) -> None:
        self._number = number
        self.name, self._here, self._there = _names(number)
        self.host = f"10.213.{subnet}.1"
        address = f"10.213.{subnet}.2"
        try:
            ip("netns", "add", self.name)
            ip(
                *("link", "add", self._here, "type", "veth"),
                *("peer", "name", self._there, "netns", self.name),
            )
            ip("addr", "add", f"{self.host}/30", "dev", self._here)
            ip("link", "set", self._here, "up")
            ip("-n", self.name, "addr", "add", f"{address}/30", "dev", self._there)
            ip("-n", self.name, "link", "set", "lo", "up")
            self.plug()
        except DeployError:
            self.close()
            raise

    @property
    def prefix(self) -> tuple[str, ...]:
        """Prefix that runs a command in the namespace, with its own process id."""
        return ("ip", "netns", "exec", self.name)

    @property
    def is_up(self) -> bool:
        """Whether both ends have a carrier; the kernel reports it up to a second after plugging."""
        ends = (("-n", self.name, "link", "show", self._there), ("link", "show", self._here))
        return all("state UP" in ip(*end) for end in ends)

    def unplug(self) -> None:
        # On the far side: the near address remains, and its listeners continue.
        ip("-n", self.name, "link", "set", self._there, "down")

    def plug(self) -> None:
        ip("-n", self.name, "link", "set", self._there, "up")

    def close(self) -> None:
        remove(self._number)


def remove(number: int) -> None:
    """Remove a namespace and its cable if they exist."""
    name, here, _ = _names(number)
    with suppress(DeployError):
        ip("link", "del", here)
    with suppress(DeployError):
        ip("netns", "del", name)


def _names(number: int) -> tuple[str, str, str]:
    """Return the names of the namespace and of the cable's two ends."""
    return f"lifeline-{number}", f"lf{number}h", f"lf{number}t"


def ip(*arguments: str, typed: str | None = None) -> str:
    """Run ip with an input; return its output.

    Raises:
        DeployError: it fails.
    """
    try:
        done = subprocess.run(
            ["ip", *arguments],  # noqa: S607 - the system's
            input=typed,
            capture_output=True,
            text=True,
            check=False,
            timeout=COMMAND_LIMIT_S,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise DeployError(f"cannot run ip: {error}") from error
    if done.returncode != 0:
        raise DeployError(f"`ip {' '.join(arguments)}` failed: {done.stderr.strip()}")
    return done.stdout
