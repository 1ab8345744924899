"""A teleop in its own terminal, a simulated operator, and the supervisor's side of the wire."""

import asyncio
import fcntl
import itertools
import os
import pty
import re
import signal
import struct
import subprocess
import sys
import termios
import time
from collections.abc import AsyncGenerator, Callable, Mapping
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any

import pyte
import pytest

from teleop.pilots.keys import TOGETHER_S
from tests.system.ports import free_endpoint
from wire import topics
from wire.messages import SafetyStatus, TriggerResponse, Twist, header
from wire.zenoh.bus import BusConfig, ZenohBus, open_bus

LIMIT_S = 20.0
"""Time limit for expected events on a loaded machine."""
INITIAL_DELAY_S, INTERVAL_S = 0.25, 0.033
"""Of the repeats of a held key."""
HEARTBEAT_S = 0.05
"""Period of teleop's heartbeat. While teleop hangs, it sends none, and the supervisor stops the robot."""
ROOT = Path(__file__).parents[2]
ZERO = (0.0, 0.0)
ALL_MODES = tuple[Any, ...]
TELEOP = ("-m", "teleop")
PATIENT = ("-m", "tests.system.patient_teleop")
DELETE_LINE = b"\x15"
"""Ctrl-U: a shell whose job was stopped or killed finds the terminal's answers to that job in its line."""
HANG_LIMIT_S = 2.0
TOLERANT = (
    "-c",
    f"""
from teleop import __main__, service
service.HANG_S = {HANG_LIMIT_S}  # a busy machine alone must not exceed it
__main__.main()
""",
)

SEQUENCE = re.compile(rb"\x1b\[([<>?=]?)([0-9;]*)(\$?[@-~])")
UNFINISHED = re.compile(rb"\x1b(\[[<>?=0-9;]*\$?)?\Z")


ARROWS_PER_NOTCH = 3
"""Of the mouse wheel, on a terminal with alternate scroll."""
AGAIN_S = 2.0
"""After this time without an effect, a person presses a key again."""

POLL_S = TOGETHER_S + 0.01
"""What is typed after a wait is not pressed together with what was typed before."""


async def until(condition: Callable[[], object], limit_s: float = LIMIT_S) -> float:
    """Wait for `condition`; return how long it took."""
    start_s = time.monotonic()
    while not condition():
        if time.monotonic() - start_s > limit_s:
            pytest.fail(f"not within {limit_s} s")
        await asyncio.sleep(POLL_S)
    return time.monotonic() - start_s


class Hub:
    """What the supervisor's side receives from teleop."""

    def __init__(self, bus: ZenohBus, source: str) -> None:
        self._source = source
        self._commands = bus.subscribe(topics.source_cmd_vel(source), depth=1000)
        self._estops = bus.subscribe(topics.ESTOP, depth=1000)
        self._changes = bus.watch_alive()
        self._status = bus.publisher(topics.STATUS)
        self._alive: set[str] = set()
        self._twists: list[Twist] = []
        self._arrivals_s: list[float] = []
        bus.serve(topics.SUPERVISOR_RESET, self._refuse)
        bus.declare_alive(topics.SUPERVISOR, bus.run_id)

    async def _refuse(self, _: str) -> TriggerResponse:
        return TriggerResponse(success=False, message="joy is not neutral")

    @property
    def velocities(self) -> list[tuple[float, float]]:
        for arrival in self._commands.take():
            if arrival.message is not None:
                self._twists.append(arrival.message)
                self._arrivals_s.append(arrival.arrival_s)
        return [(twist.linear.x, twist.angular.z) for twist in self._twists]

    @property
    def gaps_s(self) -> list[float]:
        """The changes of velocity."""
        return [after - before for before, after in itertools.pairwise(self._arrivals_s)]

    def requested_since(self, since_s: float) -> tuple[float, float]:
        """Return the time until the newest velocity first arrived [s], and the distance that was requested until then [m].

        Heartbeats repeat it, and a busy machine may count many of them before it looks.
        """
        velocities = self.velocities
        repeats = itertools.takewhile(lambda velocity: velocity == velocities[-1], reversed(velocities))
        first = len(velocities) - len(list(repeats))
        speeds_m_s = [linear_m_s for linear_m_s, _ in velocities]
        times_s = [max(since_s, arrival_s) for arrival_s in self._arrivals_s[: first + 1]]
        spans = zip(speeds_m_s, itertools.pairwise(times_s), strict=False)
        return times_s[-1] - since_s, sum(speed * (end_s - start_s) for speed, (start_s, end_s) in spans)

    def asks(self, linear_m_s: float, angular_rad_s: float) -> bool:
        return self.velocities[-1:] == [(linear_m_s, angular_rad_s)]

    def sees_teleop(self) -> bool:
        for change in self._changes.take():
            (self._alive.add if change.alive else self._alive.discard)(change.node)
        return self._source in self._alive

    def is_neutral(self) -> bool:
        """Check that teleop has its token, and that its last command is zero."""
        return self.sees_teleop() and self.asks(*ZERO)

    def is_left(self) -> bool:
        """Check that its token is gone and its last command was zero."""
        return not self.sees_teleop() and self.asks(*ZERO)

    def got_estop(self) -> bool:
        return any(a.message is not None and a.message.data for a in self._estops.take())

    def tell(self, mode: int, *reasons: str, **fields: Any) -> None:  # noqa: ANN401 - any field of the status
        self._status.put(SafetyStatus(header("base_link"), mode=mode, reasons=list(reasons), **fields))


@asynccontextmanager
async def hub(endpoint: str, source: str = "teleop") -> AsyncGenerator[Hub]:
    bus = await open_bus(BusConfig(endpoint), "hub")
    try:
        yield Hub(bus, source)
    finally:
        await bus.close()


class Operator:
    """A teleop in its own controlling terminal.

    Args:
        command: the command to run.
        term: the terminal's type.
        kitty: the supported flags of the kitty keyboard protocol; None: not supported.
        answers: whether it answers status requests, as practically every terminal does.
        obeys_1007: whether a program can keep the wheel from sending arrows, and ask for it; it cannot in kitty, for example.
            None: the terminal does not answer this question.
        environment: the environment, without the terminal's type; None: that of this process.
    """

    def __init__(
        self,
        *command: str,
        term: str = "xterm-256color",
        kitty: int | None = None,
        answers: bool = True,
        obeys_1007: bool | None = True,
        environment: Mapping[str, str] | None = None,
    ) -> None:
        self._master, self.slave = pty.openpty()
        self.kitty, self.answers, self.obeys_1007 = kitty, answers, obeys_1007
        self.kitty_flags: list[int] = []
        """As they were pushed."""
        self.modes_on = {"1007"}
        """DEC private modes that are set; most terminals begin with alternate scroll (1007)."""
        self.endpoint = ""
        self.output = ""
        self.bells = 0
        self.answered = 0
        """Number of the program's status requests that the terminal has answered."""
        self.buffers_s = 0.0
        """For how long the link between program and terminal collects what it delivers at once, in each direction."""
        self._collected = b""
        self.unanswered = 0
        self._pending = b""
        self._screens = [pyte.Screen(100, 30), pyte.Screen(100, 30)]
        self._streams = [pyte.ByteStream(screen) for screen in self._screens]
        self._screen = 0
        self.resize(100, 30)
        self.modes_before = self.modes()
        self.process = subprocess.Popen(
            ["setsid", "--ctty", *command],
            stdin=self.slave,
            stdout=self.slave,
            stderr=subprocess.PIPE,
            env={**(os.environ if environment is None else environment), "TERM": term},
            cwd=ROOT,
        )
        self._hung_up = False
        os.set_blocking(self._master, False)
        self.look(at=True)

    # --- the screen

    def look(self, *, at: bool) -> None:
        """Whether this terminal reads its input and answers."""
        loop = asyncio.get_running_loop()
        if at:
            loop.add_reader(self._master, self._read)
        else:
            loop.remove_reader(self._master)

    @property
    def picture(self) -> str:
        """The present content of the screen."""
        return "\n".join(self._screens[self._screen].display)

    @property
    def shows_status(self) -> bool:
        """Whether teleop's screen shows the mode of a supervisor: before that, it discards most keys."""
        modes = ("STOPPED", "LATE", "READY", "DRIVING", "LIMITED", "NO SUPERVISOR")
        return self.picture.lstrip().startswith(modes)

    @property
    def keys_count(self) -> bool:
        """Whether teleop's screen says that the next command moves the robot.

        Before the supervisor has confirmed a command, teleop has no measured round trip, and requests no motion: it
        discards the keys, and its screen says WAITING, STOPPED or LATE.
        """
        return "the next command moves the robot" in self.picture or "| READY" in self.picture

    @property
    def is_restored(self) -> bool:
        """Check that the terminal's modes, screen, cursor and keyboard are restored."""
        return (
            self.modes() == self.modes_before
            and self._screen == 0
            and not self._screens[0].cursor.hidden
            and "1007" in self.modes_on
            and self.modes_on <= {"7", "25", "1007"}
            and not self.kitty_flags
        )

    def modes(self) -> ALL_MODES:
        return tuple(termios.tcgetattr(self.slave))

    def resize(self, columns: int, rows: int) -> None:
        fcntl.ioctl(self.slave, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))
        for screen in self._screens:
            screen.resize(rows, columns)

    def _read(self) -> None:
        data = os.read(self._master, 4096)
        if self.buffers_s:
            asyncio.get_running_loop().call_later(self.buffers_s, self._show, data)
        else:
            self._show(data)

    def _show(self, data: bytes) -> None:
        self.output += data.decode(errors="replace")
        self.bells += data.count(b"\a")
        data = self._pending + data
        rest = UNFINISHED.search(data)
        end = len(data) if rest is None else rest.start()
        data, self._pending = data[:end], data[end:]
        at = 0
        for found in SEQUENCE.finditer(data):
            self._streams[self._screen].feed(data[at : found.start()])
            at = found.end()
            if not self._takes(found[1].decode(), found[2].decode(), found[3].decode()):
                self._streams[self._screen].feed(found[0])
        self._streams[self._screen].feed(data[at:])

    def _takes(self, private: str, number: str, final: str) -> bool:
        """Handle a sequence that pyte does not know; return False if pyte knows it."""
        if private == "?" and final in "hl":
            (self.modes_on.update if final == "h" else self.modes_on.difference_update)(number.split(";"))
            if number == "1049":
                self._screen = int(final == "h")
                self._screens[1].reset()
            return number != "25"
        if final == "$p":
            if self.answers and self.obeys_1007 is not None:
                is_set = 0 if not self.obeys_1007 else 1 if number in self.modes_on else 2
                self.type(f"\x1b[?{number};{is_set}$y".encode())
        elif final == "u":
            self._on_kitty(private, number)
        elif (number, final) == ("5", "n"):
            self.unanswered += 1
            if self.answers:
                self.answer_all()
        return final in ("u", "n", "$p")

    def _on_kitty(self, private: str, number: str) -> None:
        if self.kitty is None:
            return
        if private == ">":
            self.kitty_flags.append(int(number) & self.kitty)
        elif private == "<":
            del self.kitty_flags[-1:]
        else:
            self.type(f"\x1b[?{(self.kitty_flags or [0])[-1]}u".encode())

    # --- the keyboard

    def type(self, keys: bytes) -> None:
        if not self.buffers_s:
            os.write(self._master, keys)
            return
        if not self._collected:
            asyncio.get_running_loop().call_later(self.buffers_s, self._deliver)
        self._collected += keys

    def _deliver(self) -> None:
        collected, self._collected = self._collected, b""
        if not self._hung_up:
            os.write(self._master, collected)

    def answer_all(self) -> None:
        """Answer all open status requests, and all later ones."""
        self.type(b"\x1b[0n" * self.unanswered)
        self.answered += self.unanswered
        self.answers, self.unanswered = True, 0

    def key(self, code: int | str, event: int, modifiers: int = 1) -> None:
        """Send a key by the kitty protocol: 1 press, 2 repeat, 3 release."""
        number = ord(code) if isinstance(code, str) else code
        self.type(f"\x1b[{number};{modifiers}:{event}u".encode())

    def hold(self, code: str) -> None:
        """Press a key anew by the kitty protocol, without releasing it."""
        self.key(code, 3)
        self.key(code, 1)

    def scroll(self) -> None:
        """Turn the mouse wheel by one notch: on the alternate screen, most terminals send three arrows instead."""
        if self._screen == 1 and ("1007" in self.modes_on or not self.obeys_1007):
            self.type((b"\x1bOA" if "1" in self.modes_on else b"\x1b[A") * ARROWS_PER_NOTCH)

    def paste(self, text: bytes) -> None:
        """Paste a text, marked if the program asked for it."""
        self.type(b"\x1b[200~" + text + b"\x1b[201~" if "2004" in self.modes_on else text)

    def hang_up(self) -> None:
        """Close the terminal, like a closed window or a lost connection."""
        if not self._hung_up:
            self._hung_up = True
            self.look(at=False)
            os.close(self._master)

    def send(self, number: signal.Signals) -> None:
        self.process.send_signal(number)

    async def ended(self, limit_s: float = LIMIT_S) -> tuple[int, str]:
        """Return the exit code and standard error."""
        await until(lambda: self.process.poll() is not None, limit_s)
        _, errors = self.process.communicate()
        return self.process.returncode, errors.decode()

    def close(self) -> None:
        print(self.picture.rstrip())  # for a failed test
        self.process.kill()
        self.process.wait()
        assert self.process.stderr is not None
        self.process.stderr.close()
        self.hang_up()
        os.close(self.slave)


@asynccontextmanager
async def operator(
    endpoint: str,
    *arguments: str,
    command: tuple[str, ...] = PATIENT,
    term: str = "xterm-256color",
    kitty: int | None = None,
    answers: bool = True,
    obeys_1007: bool | None = True,
) -> AsyncGenerator[Operator]:
    made = Operator(
        sys.executable,
        *command,
        "--endpoint",
        endpoint,
        *arguments,
        term=term,
        kitty=kitty,
        answers=answers,
        obeys_1007=obeys_1007,
    )
    made.endpoint = endpoint
    try:
        yield made
    finally:
        made.close()


async def ready(h: Hub, op: Operator, limit_s: float = LIMIT_S) -> None:
    """Wait until a neutral teleop shows that its keys count; until then, the hub reports READY again and again."""
    await until(lambda: h.is_neutral() and (op.keys_count or h.tell(SafetyStatus.READY)), limit_s)


async def hold_down(op: Operator, key: bytes, condition: Callable[[], bool]) -> None:
    """Repeat a key, like a terminal without releases, until a condition holds."""
    op.type(key)
    await asyncio.sleep(INITIAL_DELAY_S)
    async with asyncio.timeout(LIMIT_S):
        while not condition():
            op.type(key)
            await asyncio.sleep(INTERVAL_S)


async def press(keys: Callable[[], object], effect: Callable[[], object]) -> None:
    """Press keys until they have an effect, as a person does: on a busy machine, they may have been typed on an old picture.

    Args:
        keys: presses them; it begins with a stop or a release if a second press would add to the first.
        effect: checks it.
    """
    for _ in range(round(LIMIT_S / AGAIN_S)):
        keys()
        with suppress(TimeoutError):
            async with asyncio.timeout(AGAIN_S):
                await until(effect)
                return
    pytest.fail("the keys have no effect")


async def press_steps(h: Hub, op: Operator, keys: bytes, linear_m_s: float) -> None:
    """Request a velocity by steps, from zero."""
    await press(lambda: op.type(b"s" + keys), lambda: h.asks(linear_m_s, 0.0))


async def drive_after_estop(h: Hub, op: Operator) -> None:
    """Confirm an e-stop, and request 0.1 m/s again; teleop sends the e-stop no more, or the test fails."""
    await until(lambda: h.tell(SafetyStatus.STOPPED, "ESTOP") or op.picture.lstrip().startswith("STOPPED"))
    await ready(h, op)
    await press_steps(h, op, b"w", 0.1)
    h.got_estop()
    seen = len(h.velocities)
    await until(lambda: len(h.velocities) >= seen + 5)
    assert h.asks(0.1, 0.0)
    assert not h.got_estop()


@asynccontextmanager
async def driving(
    *arguments: str, command: tuple[str, ...] = PATIENT
) -> AsyncGenerator[tuple[Hub, Operator]]:
    """A connected teleop that requests 0.1 m/s."""
    endpoint = free_endpoint()
    async with hub(endpoint) as h, operator(endpoint, *arguments, command=command) as op:
        await ready(h, op)
        await press_steps(h, op, b"w", 0.1)
        yield h, op
