"""`lifeline ros2 exec`: run a program that commands the robot, and hold a token exactly while it runs.

The ROS 2 process watches the token: when it disappears, the source is lost at once, on any host and with any middleware. The
token disappears when the program ends, also by SIGKILL, and when this process is killed, because the kernel closes its connection.

The program is forked at once, while this process has no threads, but waits until `start`. The kernel kills it when this
process dies, however that happens. Its own end is seen through a pidfd, without a delay. A signal that another process sends
to this process is passed on; the terminal itself sends Ctrl-C to both.
"""

import asyncio
import ctypes
import os
import signal
import sys
import threading
from collections.abc import Callable
from functools import partial
from typing import NoReturn

from pydantic import TypeAdapter, ValidationError

from deploy.stack.console import note
from deploy.stack.errors import EXIT_REFUSED, DeployError
from deploy.stack.launch import Launch
from ros2.config import Ros2Section
from wire import topics
from wire.bus_config import BusConfig
from wire.host.config import BusSection, ConfigError, FreeName, Section, read_sections, read_toml
from wire.host.notify import Notifier, take_notifier
from wire.inbox import BusError, Token
from wire.text import printable
from wire.zenoh.connect import open_session
from wire.zenoh.hub_proof import HubProof
from wire.zenoh.local_socket import pid_in
from wire.zenoh.network import network_of
from wire.zenoh.session import ZenohSession

PASSED_ON = frozenset(
    {signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGUSR1, signal.SIGUSR2}
)
IGNORED_BY_PYTHON = (signal.SIGPIPE, signal.SIGXFSZ)
"""A program that is started must not inherit this."""
_PR_SET_PDEATHSIG = 1
_CANNOT_RUN = 127


class BoundChild:
    """A program that waits for `start`.

    Create it in the main thread, before any other thread.

    Args:
        command: the program and its arguments.
    """

    def __init__(self, command: list[str]) -> None:
        before = {int(number) for number in signal.pthread_sigmask(signal.SIG_BLOCK, PASSED_ON)}
        libc = ctypes.CDLL(None)
        word_read, self._word = os.pipe()
        self._failure, failure_write = os.pipe()
        parent = os.getpid()
        self.pid = os.fork()
        if self.pid == 0:
            os.close(self._word)
            libc.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
            _run(command, before, parent, word_read, failure_write)
        os.close(word_read)
        os.close(failure_write)
        self.descriptor = os.pidfd_open(self.pid)
        """A pidfd: readable once the program has ended."""

    def start(self) -> OSError | None:
        """Let the program start; return why it cannot run."""
        os.write(self._word, b"1")
        number = os.read(self._failure, 16)  # empty: the program runs, and has closed it
        return OSError(int(number), os.strerror(int(number))) if number else None

    def send(self, number: int) -> None:
        signal.pidfd_send_signal(self.descriptor, number)

    def exit_code(self) -> int:
        """Reap the program, once it has ended; return its exit code, or 128 + N if signal N ended it."""
        code = os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])
        return code if code >= 0 else 128 - code

    def abandon(self) -> None:
        """End the program, which has not started."""
        os.close(self._word)
        os.waitpid(self.pid, 0)


def _run(command: list[str], mask: set[int], parent: int, word: int, failure: int) -> NoReturn:
    """Wait for the word, then become the program; or end."""
    try:
        if os.read(word, 1) and os.getppid() == parent:
            for number in IGNORED_BY_PYTHON:
                signal.signal(number, signal.SIG_DFL)
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
            os.execvp(command[0], command)  # noqa: S606 - the user's own command
    except OSError as error:
        os.write(failure, str(error.errno).encode())
    finally:
        os._exit(_CANNOT_RUN)


def take_signals(on_signal: Callable[[int, bool], None]) -> None:
    """Call `on_signal` on a thread of its own with each signal of `PASSED_ON`, and whether the kernel itself sent it.

    These signals must be blocked in all threads, which `BoundChild` does.
    """

    def take() -> None:
        while True:
            taken = signal.sigwaitinfo(PASSED_ON)
            on_signal(taken.si_signo, taken.si_code > 0)

    threading.Thread(target=take, daemon=True, name="signals").start()


def end(code: int) -> NoReturn:
    """End this process at once; an open Zenoh session could delay a regular exit."""
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


EXIT_NOT_FOUND, EXIT_NOT_EXECUTABLE = 127, 126
"""The exit codes of a shell for the same failures."""
REPORT_PERIOD_S = 0.1
"""Time between two turns of the loop that may report to systemd."""


def run(launch: Launch, source: str, command: list[str]) -> NoReturn:
    """Run a command, and exit with its code, or 128 + N if signal N ended it; 2 if it is refused.

    Raises:
        DeployError: the configuration is refused, or has no such source.
    """
    try:
        document = read_toml(launch.config)
        models: dict[str, type[Section]] = {"bus": BusSection}
        if topics.ROS2 in document:
            models[topics.ROS2] = Ros2Section
        sections = read_sections(document, models)
    except ConfigError as error:
        raise DeployError(str(error)) from error
    check_source(source, sections.get(Ros2Section), str(launch.config))
    notifier = take_notifier(os.environ)  # before the program inherits the environment
    child = BoundChild(command)  # before the threads of Zenoh
    code = EXIT_REFUSED
    try:
        code = asyncio.run(_hold(launch.bus, source, command[0], child, notifier))
    except BusError as error:
        note(str(error))
    finally:
        end(code)


def check_source(source: str, ros2: Ros2Section | None, config: str) -> None:
    """Refuse a name that the ROS 2 process would not watch; without `[ros2]`, which may be on another host, any name is accepted.

    Raises:
        DeployError: `[ros2]` has no such source.
    """
    try:
        TypeAdapter(FreeName).validate_python(source)
    except ValidationError as error:
        raise DeployError(
            f"{printable(source)!r} is no name of a command source: use lowercase letters, digits and _, and not the name "
            "of a node or topic"
        ) from error
    if ros2 is None or source in (names := [one.name for one in ros2.sources]):
        return
    there = f"there are {', '.join(names)}" if names else "there are none"
    raise DeployError(f"{printable(source)!r} is no source of [ros2] in {config}: {there}")


async def _hold(bus: BusConfig, source: str, program: str, child: BoundChild, notifier: Notifier) -> int:
    """Hold the token while the child runs, and return its exit code."""
    loop = asyncio.get_running_loop()
    stopped: asyncio.Future[int] = loop.create_future()
    is_running = False

    def on_signal(number: int, is_from_kernel: bool) -> None:  # noqa: FBT001 - a callback
        if not is_running:
            if not stopped.done():
                stopped.set_result(128 + number)
        elif not is_from_kernel:
            child.send(number)

    take_signals(lambda number, kernel: loop.call_soon_threadsafe(on_signal, number, kernel) and None)
    opening = asyncio.ensure_future(_session(bus))
    await asyncio.wait({opening, stopped}, return_when=asyncio.FIRST_COMPLETED)
    if stopped.done():
        child.abandon()
        return stopped.result()
    session = opening.result()
    node = f"{source}{topics.EXEC_SUFFIX}"
    session.declare_alive(node, session.run_id)
    token = session.declare_alive(node)
    await _check_alone(session, source)
    ended = asyncio.Event()
    loop.add_reader(child.descriptor, partial(_on_end, token, ended))
    if stopped.done():
        child.abandon()
        return stopped.result()
    failure = child.start()
    is_running = True
    if failure is not None:
        print(f"lifeline: cannot run {printable(program)}: {failure.strerror}", file=sys.stderr)
    else:
        _report(notifier, ended)
    await ended.wait()
    notifier.stopping()
    await session.close()
    if failure is not None:
        return EXIT_NOT_FOUND if isinstance(failure, FileNotFoundError) else EXIT_NOT_EXECUTABLE
    return child.exit_code()


async def _session(bus: BusConfig) -> ZenohSession:
    def on_wait() -> None:
        print(f"lifeline: waiting for the supervisor at {bus.endpoint}", file=sys.stderr, flush=True)

    proof = HubProof(bus, lambda sentence: print(f"lifeline: {sentence}", file=sys.stderr, flush=True))
    session = await open_session(bus, "client", on_wait=on_wait, proof=proof)
    return ZenohSession(session, bus.namespace, proof=proof)


def _report(notifier: Notifier, ended: asyncio.Event) -> None:
    """Report to systemd until the program has ended; in the loop, because only the loop can withdraw the token."""
    loop = asyncio.get_running_loop()
    if not ended.is_set():
        notifier.running(loop.time())
        loop.call_later(REPORT_PERIOD_S, _report, notifier, ended)


def _on_end(token: Token, ended: asyncio.Event) -> None:
    if not ended.is_set():
        token.withdraw()
        ended.set()


async def _check_alone(session: ZenohSession, source: str) -> None:
    """Refuse to be the second holder of a token: the token would remain when the first holder ends.

    Raises:
        BusError: another session holds it.
    """
    others = await session.holders(f"{source}{topics.EXEC_SUFFIX}") - {session.run_id}
    if others:
        network = network_of(await session.hub_entry())
        holder = next((s for s in network.sessions if bytes.fromhex(s.session_id.zfill(32)) in others), None)
        if holder is None:
            where = "behind a router"
        elif holder.is_at_socket:
            where = f"as process {pid_in(holder.session_id)}"
        else:
            where = f"at {holder.address}"
        raise BusError(f"another `lifeline ros2 exec --source {source}` runs already, {where}: end it first")
