"""Teleop on a memory bus in virtual time: what it says on the wire, and when."""

import asyncio
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager
from typing import Any, cast

import pytest

from teleop.config import TeleopSection
from teleop.display import Line
from teleop.keymap import CTRL_C
from teleop.service import SCREEN_LIMIT_S, Teleop
from wire import topics
from wire.memory_bus import MemoryBus, MemoryNetwork
from wire.messages import Bool, SafetyStatus, TriggerResponse, Twist, decode, header

CMD_VEL = topics.source_cmd_vel("teleop")
PERIOD_S = 0.05
INSTANT_S = 1e-4
"""Long enough for everything that happens at once, short against every period."""


class Wire(MemoryNetwork):
    """Also remembers, in order, when what was said on which key."""

    def __init__(self) -> None:
        super().__init__()
        self.said: list[tuple[float, str, Any]] = []

    def deliver(self, key: str, payload: bytes, attachment: bytes | None) -> None:
        types = {CMD_VEL.key: Twist, topics.ESTOP.key: Bool}
        if key in types:
            message: Any = decode(payload, types[key])
            value = message.data if key == topics.ESTOP.key else (message.linear.x, message.angular.z)
            self.said.append((asyncio.get_running_loop().time(), key, value))
        super().deliver(key, payload, attachment)

    def commands(self) -> list[tuple[float, tuple[float, float]]]:
        return [(time_s, value) for time_s, key, value in self.said if key == CMD_VEL.key]

    def estops(self) -> list[float]:
        return [time_s for time_s, key, value in self.said if key == topics.ESTOP.key and value]

    def alive(self) -> list[str]:
        return [token.node for token in self.tokens]


class Keys:
    """A keyboard for the test to press."""

    def __init__(self, wake: asyncio.Event) -> None:
        self._wake = wake
        self._pressed: list[str] = []
        self.ended = False

    def press(self, keys: str) -> None:
        self._pressed += keys
        self._wake.set()

    def end(self) -> None:
        self.ended = True
        self._wake.set()

    def take(self) -> list[str]:
        pressed, self._pressed = self._pressed, []
        return pressed


class PaperScreen:
    """A terminal that keeps everything; it may get stuck or break."""

    def __init__(self) -> None:
        self.width = 79
        self.lines: list[str] = []
        self.notes: list[str] = []
        self.stuck = False
        self.broken = False

    def show(self, line: Line) -> bool:
        if self.broken:
            raise RuntimeError("broken screen")
        if not self.stuck:
            self.lines.append("".join(segment.text for segment in line))
        return not self.stuck

    def note(self, text: str) -> None:
        self.notes.append(text)


class Bench:
    """A running Teleop with everything around it."""

    def __init__(self) -> None:
        self.wire = Wire()
        self.supervisor = MemoryBus(self.wire)
        self.stop = asyncio.Event()
        self.resets = 0
        wake = asyncio.Event()
        self.keys, self.screen = Keys(wake), PaperScreen()
        teleop = Teleop(
            MemoryBus(self.wire),
            TeleopSection(),
            keys=self.keys,
            screen=self.screen,
            wake=wake,
            endpoint="tcp/127.0.0.1:7447",
        )
        self.start_s = asyncio.get_running_loop().time()
        self.running = asyncio.create_task(teleop.run(self.stop))

    async def press(self, keys: str) -> None:
        self.keys.press(keys)
        await asyncio.sleep(INSTANT_S)

    def velocity(self) -> tuple[float, float]:
        return self.wire.commands()[-1][1]

    def tell(self, mode: int, *reasons: str) -> None:
        status = SafetyStatus(header("base_link", 0), mode=mode, reasons=list(reasons))
        self.supervisor.publisher(topics.STATUS).put(status)

    def serve_reset(self, response: TriggerResponse, *, after_s: float = 0.0) -> None:
        async def reset(_: str) -> TriggerResponse:
            self.resets += 1
            await asyncio.sleep(after_s)
            return response

        self.supervisor.serve(topics.SUPERVISOR_RESET, reset)


@asynccontextmanager
async def bench() -> AsyncGenerator[Bench]:
    made = Bench()
    await asyncio.sleep(INSTANT_S)
    try:
        yield made
    finally:
        made.running.cancel()
        await asyncio.wait({made.running})


def hang(seconds: float) -> None:
    """Time passes while this loop does not turn."""
    cast("Any", asyncio.get_running_loop())._selector.clock.advance(seconds)


def on_the_beat(bench: Bench, count: int) -> object:
    return pytest.approx([bench.start_s + n * PERIOD_S for n in range(count)], abs=1e-4)


async def test_the_heartbeat_is_twenty_neutral_twists_a_second_from_the_start() -> None:
    async with bench() as b:
        await asyncio.sleep(1.0)
        assert [time_s for time_s, _ in b.wire.commands()] == on_the_beat(b, 21)
        assert {value for _, value in b.wire.commands()} == {(0.0, 0.0)}


async def test_the_heartbeat_does_not_drift_in_an_hour() -> None:
    async with bench() as b:
        await asyncio.sleep(3600.0)
        assert len(b.wire.commands()) == 72_001
        assert b.wire.commands()[-1][0] == pytest.approx(b.start_s + 3600.0, abs=1e-4)


async def test_a_key_is_published_at_once_and_leaves_the_beat_alone() -> None:
    async with bench() as b:
        await asyncio.sleep(0.02)
        await b.press("w")
        assert b.wire.commands()[1:] == [(pytest.approx(b.start_s + 0.0201, abs=1e-4), (0.1, 0.0))]
        await asyncio.sleep(0.09)
        times = [time_s - b.start_s for time_s, _ in b.wire.commands()[2:]]
        assert times == [pytest.approx(0.05, abs=1e-4), pytest.approx(0.10, abs=1e-4)]
        assert b.velocity() == (0.1, 0.0)


async def test_an_unknown_key_says_nothing() -> None:
    async with bench() as b:
        await b.press("zé\t5")
        assert len(b.wire.commands()) == 1


async def test_a_press_at_the_limit_is_no_change_and_not_published() -> None:
    async with bench() as b:
        await b.press("w" * 15)
        assert [value for _, value in b.wire.commands()] == [(n / 10, 0.0) for n in range(11)]


async def test_s_is_published_even_where_it_changes_nothing() -> None:
    async with bench() as b:
        await b.press("s")
        assert [value for _, value in b.wire.commands()] == [(0.0, 0.0), (0.0, 0.0)]


async def test_a_stop_between_two_presses_is_not_skipped() -> None:
    async with bench() as b:
        await b.press("wsw")
        assert [value for _, value in b.wire.commands()][1:] == [(0.1, 0.0), (0.0, 0.0), (0.1, 0.0)]


async def test_space_publishes_zero_and_then_the_emergency_stop() -> None:
    async with bench() as b:
        await b.press("wa")
        b.wire.said.clear()
        await b.press(" ")
        assert [(key, value) for _, key, value in b.wire.said] == [
            (CMD_VEL.key, (0.0, 0.0)),
            (topics.ESTOP.key, True),
        ]


async def test_the_emergency_stop_is_repeated_until_the_supervisor_shows_it() -> None:
    async with bench() as b:
        b.tell(SafetyStatus.STOPPED, "ESTOP")  # of an earlier press: it proves nothing for this one
        await asyncio.sleep(0.01)
        await b.press(" ")
        await asyncio.sleep(1.0)
        repeated = len(b.wire.estops())
        assert repeated == 21
        b.tell(SafetyStatus.READY)
        await asyncio.sleep(0.1)
        assert len(b.wire.estops()) == repeated + 2
        b.tell(SafetyStatus.STOPPED, "ESTOP")
        await asyncio.sleep(1.0)
        assert len(b.wire.estops()) == repeated + 2


async def test_a_reset_ends_the_repeating_of_the_emergency_stop() -> None:
    async with bench() as b:
        b.serve_reset(TriggerResponse(success=True, message="released"))
        await b.press(" r")
        await asyncio.sleep(1.0)
        assert len(b.wire.estops()) == 1


@pytest.mark.parametrize("key", ["q", "Q", CTRL_C])
async def test_quit_publishes_zero_and_withdraws_the_token(key: str) -> None:
    async with bench() as b:
        assert b.wire.alive() == ["teleop"]
        await b.press("wwd")
        await b.press(key)
        assert b.running.done()
        assert b.running.result() is None
        assert b.velocity() == (0.0, 0.0)
        assert b.wire.alive() == []


async def test_keys_after_the_quit_move_nothing() -> None:
    async with bench() as b:
        await b.press("qw")
        assert b.running.done()
        assert {value for _, value in b.wire.commands()} == {(0.0, 0.0)}


async def test_the_signal_to_stop_does_the_same_at_once() -> None:
    async with bench() as b:
        await b.press("w")
        b.stop.set()
        await asyncio.sleep(INSTANT_S)
        assert (b.running.done(), b.velocity(), b.wire.alive()) == (True, (0.0, 0.0), [])


async def test_the_end_of_the_keys_does_the_same_at_once() -> None:
    async with bench() as b:
        await b.press("w")
        b.keys.end()
        await asyncio.sleep(INSTANT_S)
        assert (b.running.done(), b.velocity(), b.wire.alive()) == (True, (0.0, 0.0), [])


async def test_after_a_hang_there_is_no_burst_and_the_beat_goes_on_in_step() -> None:
    async with bench() as b:
        await asyncio.sleep(0.11)
        b.wire.said.clear()
        hang(3.0)
        await asyncio.sleep(INSTANT_S)
        assert len(b.wire.commands()) == 1
        await asyncio.sleep(0.1)
        assert [round(time_s - b.start_s, 2) for time_s, _ in b.wire.commands()][1:] == [3.15, 3.2]


async def test_after_a_hang_the_setpoint_is_zero_and_the_operator_is_told() -> None:
    async with bench() as b:
        await b.press("www")
        hang(1.0)
        await asyncio.sleep(INSTANT_S)
        assert b.velocity() == (0.0, 0.0)
        assert any("hung for 1.0 s" in note for note in b.screen.notes)


async def test_keys_typed_during_a_hang_stop_but_never_move() -> None:
    async with bench() as b:
        await b.press("w")
        b.wire.said.clear()
        b.keys.press("s www a ")
        hang(1.0)
        await asyncio.sleep(1.0)
        assert {value for _, value in b.wire.commands()} == {(0.0, 0.0)}
        assert b.wire.estops() != []


async def test_a_beat_that_is_only_late_is_no_hang() -> None:
    async with bench() as b:
        await b.press("w")
        hang(0.19)
        await asyncio.sleep(INSTANT_S)
        assert b.velocity() == (0.1, 0.0)


async def test_a_refused_reset_shows_the_supervisors_reason() -> None:
    async with bench() as b:
        b.serve_reset(TriggerResponse(success=False, message="source joy is not neutral\x1b[2J"))
        await b.press("r")
        assert b.screen.notes == ["reset refused: source joy is not neutral?[2J"]


async def test_a_reset_that_was_done_is_shown() -> None:
    async with bench() as b:
        b.serve_reset(TriggerResponse(success=True, message="released, press s"))
        await b.press("r")
        assert b.screen.notes == ["reset done: released, press s"]


async def test_a_reset_that_nobody_answers_is_shown() -> None:
    async with bench() as b:
        await b.press("r")
        assert "nobody answered" in b.screen.notes[0]
        assert not b.running.done()


async def test_a_slow_reset_does_not_delay_the_heartbeat() -> None:
    async with bench() as b:
        b.serve_reset(TriggerResponse(success=True, message="at last"), after_s=0.9)
        await b.press("rrr")
        await asyncio.sleep(1.0)
        assert [time_s for time_s, _ in b.wire.commands()] == on_the_beat(b, 21)
        assert (b.screen.notes, b.resets) == (["reset done: at last"], 1)


async def test_an_error_in_the_reset_ends_teleop_with_a_zero_and_without_token() -> None:
    async with bench() as b:

        async def broken(_: str) -> TriggerResponse:
            raise RuntimeError("broken reset")

        b.supervisor.serve(topics.SUPERVISOR_RESET, broken)
        await b.press("wr")
        assert isinstance(b.running.exception(), RuntimeError)
        assert (b.velocity(), b.wire.alive()) == ((0.0, 0.0), [])


async def test_an_error_on_the_screen_ends_teleop_with_a_zero_and_without_token() -> None:
    async with bench() as b:
        await b.press("w")
        b.screen.broken = True
        await asyncio.sleep(0.2)
        assert isinstance(b.running.exception(), RuntimeError)
        assert (b.velocity(), b.wire.alive()) == ((0.0, 0.0), [])


async def test_a_screen_that_is_stuck_for_too_long_stops_the_robot() -> None:
    async with bench() as b:
        await b.press("w")
        b.screen.stuck = True
        await asyncio.sleep(SCREEN_LIMIT_S - 0.1)
        assert b.velocity() == (0.1, 0.0)
        await asyncio.sleep(0.3)
        assert b.velocity() == (0.0, 0.0)
        assert any("took no output" in note for note in b.screen.notes)


async def test_the_line_shows_the_status_and_then_its_absence() -> None:
    async with bench() as b:
        assert "waiting for the supervisor" in b.screen.lines[-1]
        b.tell(SafetyStatus.STOPPED, "COMMAND_TIMEOUT")
        await asyncio.sleep(0.15)
        assert "STOPPED: COMMAND_TIMEOUT - press s to re-arm" in b.screen.lines[-1]
        await asyncio.sleep(1.1)
        assert "supervisor: silent for 1.2 s" in b.screen.lines[-1]


async def test_the_line_is_drawn_ten_times_a_second_however_many_statuses_come() -> None:
    async with bench() as b:
        for _ in range(100):
            b.tell(SafetyStatus.READY)
            await asyncio.sleep(0.01)
        assert len(b.screen.lines) == 11


async def test_a_key_is_drawn_at_once() -> None:
    async with bench() as b:
        await asyncio.sleep(0.03)
        await b.press("w")
        assert b.screen.lines[-1].startswith("v +0.10 m/s")


async def test_an_undecodable_status_leaves_the_last_one_to_age() -> None:
    async with bench() as b:
        b.tell(SafetyStatus.READY)
        await asyncio.sleep(0.1)
        b.wire.deliver(topics.STATUS.key, b"\x00\x01", None)
        await asyncio.sleep(1.0)
        assert "silent" in b.screen.lines[-1]
