"""Starts the processes of one ROS domain, reads their lines, and ends them.

Each test has a ROS_DOMAIN_ID of its own. A process that does not end within its time is killed. Fast DDS keeps files in
/dev/shm; those of killed processes remain, and are removed here.
"""

import fcntl
import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

import pexpect

from ros2.environment import DISCOVERY_RANGE, dds_variables, ros_variables
from tests.ros2.peers.lines import READY

ROOT = Path(__file__).parents[2]
ROS_PYTHON = ROOT / ".ros2/bin/python"
PATIENCE_S = 30.0
"""Time limit for expected events on a loaded machine."""
END_LIMIT_S = 5.0
DOMAINS = range(30, 100)
"""Above those that people use by hand; from 102 on, the ports of a domain are those of outgoing connections."""
SHARED_MEMORY = Path("/dev/shm")
WITH_SHARED_MEMORY = {DISCOVERY_RANGE: "LOCALHOST"}
"""How Fast DDS communicates on one host by default."""
PORTS_FROM, PORTS_PER_DOMAIN = 7400, 250
"""How DDS numbers its ports by domain."""

Line = dict[str, Any]


@contextmanager
def ros_domain(first: int | None = None) -> Generator[int]:
    """Yield a domain that no other test on this machine has; a lock on a file claims it until this process ends.

    Args:
        first: the domain to try first; None: one that depends on this process.
    """
    before = os.getpid() % len(DOMAINS) if first is None else DOMAINS.index(first)
    for domain in [*DOMAINS[before:], *DOMAINS[:before]]:
        with Path(f"/tmp/lifeline-ros-domain-{domain}").open("w") as claim:
            try:
                fcntl.flock(claim, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                continue
            yield domain
            return
    raise AssertionError("no free ROS domain")


class Peer:
    """A process whose stdout is lines of JSON.

    Args:
        name: for the errors.
        process: its stdin and stdout are text pipes.
        log: where its stderr goes.
        ends_with_stdin: whether it leaves when stdin is closed.
    """

    def __init__(
        self, name: str, process: "subprocess.Popen[str]", log: Path, *, ends_with_stdin: bool
    ) -> None:
        self.name, self.process = name, process
        self._ends_with_stdin = ends_with_stdin
        self.lines: list[Line] = []
        self.shared_memory: set[str] = set()
        """Fast DDS's files that it used when it was killed or ended."""
        self.log = log
        """Where its stderr goes."""
        self._changed = threading.Condition()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    @property
    def pid(self) -> int:
        return self.process.pid

    def _read(self) -> None:
        with _of(self.process.stdout) as stdout:
            for line in stdout:
                if not line.startswith("{"):  # Fast DDS prints its errors there too
                    continue
                with self._changed:
                    self.lines.append(json.loads(line))
                    self._changed.notify_all()
        with self._changed:
            self._changed.notify_all()

    def tell(self, **fields: Any) -> None:  # noqa: ANN401 - any values of JSON
        stdin = _of(self.process.stdin)
        stdin.write(json.dumps(fields) + "\n")
        stdin.flush()

    def until(
        self, condition: Callable[[Line], bool], what: str, *, after: int = 0, within_s: float = PATIENCE_S
    ) -> Line:
        """Wait for a line that meets the condition, and return it.

        Args:
            condition: called once for each line.
            what: the expectation, for the error.
            after: the number of lines to skip, such as `len(peer.lines)` for only new ones.
            within_s: the time limit.
        """
        deadline_s = time.monotonic() + within_s
        seen = after
        with self._changed:
            while True:
                for line in self.lines[seen:]:
                    if condition(line):
                        return line
                seen = max(seen, len(self.lines))
                left_s = deadline_s - time.monotonic()
                if left_s <= 0 or not self._reader.is_alive():
                    raise AssertionError(
                        f"{self.name}: not seen within {within_s:g} s: {what}; {self.picture()}"
                    )
                self._changed.wait(left_s)

    def ready(self) -> "Peer":
        """Wait until it runs, and return it."""
        self.until(lambda line: READY in line, "the start")
        return self

    def of(self, topic: str, *, from_ns: int = 0) -> list[Line]:
        """Return an observer's lines of one topic that arrived at `from_ns` or later."""
        return [line for line in list(self.lines) if line.get("topic") == topic and line["at_ns"] >= from_ns]

    def picture(self) -> str:
        return f"exit code {self.process.poll()}, last lines {self.lines[-3:]}, log: {self.log.read_text()[-1500:]}"

    def kill(self) -> int:
        """SIGKILL and reap it; return the time just before, by CLOCK_MONOTONIC [ns]."""
        self.shared_memory = shared_memory_of(self.pid)
        at_ns = time.monotonic_ns()
        self.process.kill()
        self.process.wait(END_LIMIT_S)
        return at_ns

    def end(self) -> None:
        """Close its stdin, or send SIGTERM if it ignores that; then SIGTERM, then SIGKILL."""
        self.shared_memory |= shared_memory_of(self.pid)
        with suppress(BrokenPipeError):
            self.process.send_signal(signal.SIGCONT)
            _of(self.process.stdin).close()
        if not self._ends_with_stdin:
            self.process.terminate()
        for escalate in (self.process.terminate, self.process.kill, None):
            try:
                self.process.wait(END_LIMIT_S)
                break
            except subprocess.TimeoutExpired:
                assert escalate is not None, f"{self.name} did not end"
                escalate()
        self._reader.join(END_LIMIT_S)


def _of(pipe: IO[str] | None) -> IO[str]:
    assert pipe is not None
    return pipe


class Host:
    """The processes on one machine and in one domain.

    Args:
        domain: the ROS domain.
        logs: where their stderr goes.
        prefix: starts each command, such as `ip netns exec NAME`.
        discovery: how its peers find others; default: the variables of the process `ros2` on one host.
        extra: further environment variables.
    """

    def __init__(
        self,
        domain: int,
        logs: Path,
        *,
        prefix: Sequence[str] = (),
        discovery: dict[str, str] | None = None,
        extra: dict[str, str] | None = None,
    ) -> None:
        self.domain = domain
        self._logs, self._prefix, self._extra = logs, prefix, extra or {}
        self._discovery = dds_variables("localhost", {}) if discovery is None else discovery
        self._peers: list[Peer] = []
        self._terminals: list[pexpect.spawn[str]] = []
        self._used: set[str] = set()

    @property
    def variables(self) -> dict[str, str]:
        """The environment of a peer."""
        return {**self.rclpy_variables, **self._discovery, **self._extra}

    @property
    def rclpy_variables(self) -> dict[str, str]:
        """The environment of a process with rclpy that chooses its discovery itself."""
        own = {
            "ROS_DOMAIN_ID": str(self.domain),
            "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp",
            "ROS_LOG_DIR": str(self._logs),
        }
        return {**os.environ, **ros_variables(ROS_PYTHON, os.environ), **own}

    def start(self, peer: str, *options: str) -> Peer:
        """Start a peer, a module of `tests/ros2/peers`, in the environment of ROS."""
        command = [str(ROS_PYTHON), "-m", f"tests.ros2.peers.{peer}", *options]
        return self.run(peer, command, self.variables, ends_with_stdin=True)

    def start_node(self, node: str, *options: str) -> Peer:
        """Start a process of Lifeline, such as `sim`, in the environment of this test."""
        return self.run(node, [sys.executable, "-m", node, *options], dict(os.environ))

    def run(
        self,
        name: str,
        command: Sequence[str],
        variables: dict[str, str],
        *,
        ends_with_stdin: bool = False,
    ) -> Peer:
        """Start any command that may print lines of JSON."""
        log = self._logs / f"{name}-{len(self._peers)}.log"
        with log.open("wb") as stderr:
            process = subprocess.Popen(
                [*self._prefix, *command],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=stderr,
                text=True,
                cwd=ROOT,
                env=variables,
            )
        peer = Peer(name, process, log, ends_with_stdin=ends_with_stdin)
        self._peers.append(peer)
        return peer

    def in_terminal(self, *command: str) -> "pexpect.spawn[str]":
        """Start a program of the ROS environment in a terminal of its own: arguments of its Python."""
        words = [*self._prefix, str(ROS_PYTHON), *command]
        terminal: pexpect.spawn[str] = pexpect.spawn(
            words[0], words[1:], cwd=str(ROOT), env=self.variables, encoding="utf-8", timeout=PATIENCE_S
        )
        terminal.delaybeforesend = None
        self._terminals.append(terminal)
        return terminal

    def kill_terminal(self, terminal: "pexpect.spawn[str]") -> int:
        """SIGKILL and reap the program in a terminal; return the time just before, by CLOCK_MONOTONIC [ns]."""
        assert terminal.pid is not None
        self._used |= shared_memory_of(terminal.pid)
        at_ns = time.monotonic_ns()
        if terminal.isalive():
            terminal.kill(signal.SIGKILL)
            terminal.wait()
        terminal.close(force=True)
        return at_ns

    def close(self) -> None:
        """End all processes, the last one first, and remove the files that killed ones left in /dev/shm."""
        for terminal in reversed(self._terminals):
            if not terminal.closed:
                self.kill_terminal(terminal)
        for peer in reversed(self._peers):
            peer.end()
            self._used |= peer.shared_memory
        self._used |= {path.name for path in SHARED_MEMORY.glob("*fastrtps_port*") if self._is_own_port(path)}
        in_use = {
            file for entry in Path("/proc").glob("[0-9]*") for file in shared_memory_of(int(entry.name))
        }
        for file in self._used - in_use:
            for name in (file, f"{file}_el"):
                (SHARED_MEMORY / name).unlink(missing_ok=True)

    def _is_own_port(self, path: Path) -> bool:
        """Return whether a file belongs to a port of this domain, which no other process may use now."""
        found = re.search(r"port(\d+)", path.name)
        return found is not None and (int(found[1]) - PORTS_FROM) // PORTS_PER_DOMAIN == self.domain


def shared_memory_of(pid: int) -> set[str]:
    """Return the names of Fast DDS's files in /dev/shm that a process maps or has open; none if it has ended."""
    found: set[str] = set()
    with suppress(OSError):
        for line in Path(f"/proc/{pid}/maps").read_text().splitlines():
            found.add(line.rpartition(" ")[2])
        for link in Path(f"/proc/{pid}/fd").iterdir():
            with suppress(OSError):
                found.add(str(link.readlink()))
    return {Path(path).name for path in found if path.startswith(f"{SHARED_MEMORY}/") and "fastrtps" in path}
