"""Teleop on a perfect network in virtual time: what it publishes when."""

import asyncio
from collections.abc import AsyncGenerator, Sequence
from contextlib import asynccontextmanager
from dataclasses import replace
from itertools import pairwise
from typing import Any, cast

import pytest

from teleop.holder import ASK_LIMIT_S, POLL_S, SILENT_LIMIT_S, HeldError
from teleop.pilots.keyboard import Hold, Incremental
from teleop.pilots.keys import CTRL_C, CTRL_D, CTRL_Z, FOCUS_OUT, PASTED, PRESENCE_KEY, SEVERAL
from teleop.pilots.pilot import NEUTRAL, RAMP_PERIOD_S, KeyEvent, KeyKind, Pilot, Ramp, Velocity
from teleop.pilots.vigilance import DEMAND_S
from teleop.screen.controls import help_lines, key_help
from teleop.screen.display import render
from teleop.screen.view import Control, Line, View
from teleop.service import IGNORED_PERIOD_S, MIN_GAP_S, RESET_TIMEOUT_S, SCREEN_LIMIT_S, Setup, Teleop
from tests.unit.teleop.views import source
from virtual.loop import VirtualLoop
from virtual.network import VirtualNetwork
from wire import topics
from wire.messages import SafetyStatus, Time, TriggerResponse, encode, header
from wire.stamp import Stamp

CMD_VEL = topics.source_cmd_vel("teleop")
PERIOD_S = 0.05
VIGILANCE_S = Setup("", "", Control.INCREMENTAL).vigilance_s
INSTANT_S = 4e-4
RUN = b"some other run.."
"""The epoch of another program."""
"""Long enough for immediate reactions, short against every period."""


class Wire(VirtualNetwork):
    """Also records all messages with time and key, in order."""

    def __init__(self) -> None:
        super().__init__()
        self.tap = self._hear
        self.supervisor = self.open_hub(topics.SUPERVISOR)
        self.said: list[tuple[float, str, Any]] = []
        self.epochs: list[bytes] = []
        """Each command once."""

    def _hear(self, _node: str, key: str, message: Any, stamp: Stamp) -> None:  # noqa: ANN401 - of any topic
        encode(message)
        if key in {CMD_VEL.key, topics.ESTOP.key}:
            value = message.data if key == topics.ESTOP.key else (message.linear.x, message.angular.z)
            self.said.append((asyncio.get_running_loop().time(), key, value))
        if key == CMD_VEL.key and stamp.gid not in self.epochs:
            self.epochs.append(stamp.gid)

    def commands(self) -> list[tuple[float, tuple[float, float]]]:
        return [(time_s, value) for time_s, key, value in self.said if key == CMD_VEL.key]

    def estops(self) -> list[float]:
        return [time_s for time_s, key, value in self.said if key == topics.ESTOP.key and value]

    def alive(self) -> list[str]:
        return self.supervisor.alive


class Keys:
    """A keyboard for the test to press."""

    def __init__(self, wake: asyncio.Event) -> None:
        self._wake = wake
        self._pressed: list[KeyEvent] = []
        self.ended = False

    def press(self, keys: str) -> None:
        self.happen(*(KeyEvent(key) for key in keys))

    def happen(self, *events: KeyEvent) -> None:
        self._pressed += events
        self._wake.set()

    def end(self) -> None:
        self.ended = True
        self._wake.set()

    def take(self) -> list[KeyEvent]:
        pressed, self._pressed = self._pressed, []
        return pressed


class PaperScreen:
    """A terminal that keeps everything, and that can hang or fail."""

    size = (80, 24)

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.drawn_s: list[float] = []
        self.notes: list[str] = []
        self.rang_s: list[float] = []
        self.doubted_s: list[float] = []
        self.suspended = 0
        self.on_suspend = lambda: None
        self.stuck = False
        self.broken = False

    def show(self, lines: Sequence[Line]) -> bool:
        if self.broken:
            raise RuntimeError("broken screen")
        if not self.stuck:
            self.lines += ["".join(segment.text for segment in line) for line in lines]
            self.drawn_s.append(asyncio.get_running_loop().time())
        return not self.stuck

    def note(self, text: str) -> None:
        self.notes.append(text)

    def bell(self) -> None:
        self.rang_s.append(asyncio.get_running_loop().time())

    def doubt(self) -> None:
        self.doubted_s.append(asyncio.get_running_loop().time())

    def suspend(self) -> None:
        self.suspended += 1
        self.on_suspend()


class Bench:
    """A running Teleop with its surroundings, and a ramp too steep to matter."""

    def __init__(
        self,
        wire: Wire | None = None,
        pilot: Pilot | None = None,
        control: Control = Control.INCREMENTAL,
        *,
        pictures: bool = True,
    ) -> None:
        self.wire = wire or Wire()
        self.supervisor = self.wire.supervisor
        self.stop = asyncio.Event()
        self.resets = 0
        self.wake = asyncio.Event()
        self.keys, self.screen = Keys(self.wake), PaperScreen()
        if pilot is None and control is not Control.VIEW_ONLY:
            pilot = Incremental(Ramp(1e6, 1e6))
        self.bus = self.wire.open_joined("teleop")
        teleop = Teleop(
            self.bus,
            Setup(
                "teleop",
                "tcp/127.0.0.1:7447",
                control,
                about=f"the teleop of {id(self)}",
                pictures=pictures,
            ),
            pilot=pilot,
            keys=self.keys,
            screen=self.screen,
            render=self._render,
            wake=self.wake,
        )
        self.running = asyncio.create_task(teleop.run(self.stop))
        self.running.add_done_callback(lambda _: self.bus.die())
        self.start_s = 0.0

    def _render(self, view: View, columns: int, _: int) -> list[Line]:
        self.view = view
        return [render(view, columns - 1)]

    async def started(self) -> None:
        """Wait until it has claimed its name and drives."""
        while not self.screen.lines and not self.running.done():  # noqa: ASYNC110 - the first picture is no event
            await asyncio.sleep(INSTANT_S)
        self.start_s = next((at_s for at_s, _ in self.wire.commands()), 0.0)
        self.tell(SafetyStatus.READY)  # of a supervisor that reports no stamps
        await asyncio.sleep(INSTANT_S)

    async def ended(self) -> None:
        """Wait until it has ended and its token's end has arrived."""
        await asyncio.wait({self.running})
        await asyncio.sleep(INSTANT_S)

    async def press(self, keys: str) -> None:
        self.keys.press(keys)
        await asyncio.sleep(INSTANT_S)

    def velocity(self) -> tuple[float, float]:
        return self.wire.commands()[-1][1]

    def tell(self, mode: int, *reasons: str, **fields: Any) -> None:  # noqa: ANN401 - any field of the status
        status = SafetyStatus(header("base_link", 0), mode=mode, reasons=list(reasons), **fields)
        self.supervisor.publisher(topics.STATUS).put(status)

    def serve_reset(self, response: TriggerResponse, *, after_s: float = 0.0) -> None:
        async def reset(_: str) -> TriggerResponse:
            self.resets += 1
            await asyncio.sleep(after_s)
            return response

        self.supervisor.serve(topics.SUPERVISOR_RESET, reset)


@asynccontextmanager
async def bench(
    pilot: Pilot | None = None,
    control: Control = Control.INCREMENTAL,
    wire: Wire | None = None,
    *,
    pictures: bool = True,
) -> AsyncGenerator[Bench]:
    made = Bench(wire, pilot, control, pictures=pictures)
    await made.started()
    try:
        yield made
    finally:
        made.running.cancel()
        await asyncio.wait({made.running})


def hang(seconds: float) -> None:
    """Time passes while this loop does not turn."""
    cast("VirtualLoop", asyncio.get_running_loop()).advance(seconds)


def on_the_beat(bench: Bench, count: int) -> object:
    return pytest.approx([bench.start_s + n * PERIOD_S for n in range(count)], abs=1e-4)


async def test_the_heartbeat_is_twenty_neutral_twists_a_second_from_the_start() -> None:
    async with bench() as b:
        await asyncio.sleep(1.0)
        assert [time_s for time_s, _ in b.wire.commands()] == on_the_beat(b, 21)
        assert {value for _, value in b.wire.commands()} == {(0.0, 0.0)}


@pytest.mark.proof
async def test_the_heartbeat_does_not_drift_in_an_hour() -> None:
    async with bench() as b:
        await asyncio.sleep(3600.0)
        assert len(b.wire.commands()) == 72_001
        assert b.wire.commands()[-1][0] == pytest.approx(b.start_s + 3600.0, abs=1e-4)


async def test_a_key_is_published_at_once_and_leaves_the_beat_alone() -> None:
    async with bench() as b:
        await asyncio.sleep(0.02)
        pressed_s = asyncio.get_running_loop().time()
        await b.press("w")
        assert b.wire.commands()[1:] == [(pytest.approx(pressed_s, abs=1e-4), (0.1, 0.0))]
        await asyncio.sleep(0.09)
        times = [time_s - b.start_s for time_s, _ in b.wire.commands()[2:]]
        assert times == [pytest.approx(0.05, abs=1e-4), pytest.approx(0.10, abs=1e-4)]
        assert b.velocity() == (0.1, 0.0)


async def test_an_unknown_key_moves_nothing() -> None:
    async with bench() as b:
        await b.press("zé\t5")
        assert {value for _, value in b.wire.commands()} == {(0.0, 0.0)}


async def test_a_press_at_the_limit_is_no_change_and_not_published() -> None:
    async with bench() as b:
        for _ in range(15):
            await b.press("w")
        assert [value for _, value in b.wire.commands()] == [(n / 10, 0.0) for n in range(11)]


async def test_s_is_published_even_where_it_changes_nothing() -> None:
    async with bench() as b:
        await b.press("s")
        assert [value for _, value in b.wire.commands()] == [(0.0, 0.0), (0.0, 0.0)]


async def test_a_stop_between_two_presses_is_not_skipped() -> None:
    async with bench() as b:
        await b.press("wsw")
        await asyncio.sleep(2 * RAMP_PERIOD_S)
        assert [value for _, value in b.wire.commands()][1:4] == [(0.1, 0.0), (0.0, 0.0), (0.1, 0.0)]


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


@pytest.mark.parametrize("key", ["q", "Q", CTRL_C, CTRL_D])
async def test_quit_publishes_zero_and_withdraws_the_token(key: str) -> None:
    async with bench() as b:
        assert b.wire.alive() == ["teleop"]
        await b.press("wwd")
        await b.press(key)
        assert b.velocity() == (0.0, 0.0)
        assert b.wire.alive() == ["teleop"], "Zenoh could send the end of the token before the zero"
        await b.ended()
        assert b.running.result() is None
        assert b.wire.alive() == []


async def test_keys_after_the_quit_move_nothing() -> None:
    async with bench() as b:
        await b.press("qw")
        await b.ended()
        assert {value for _, value in b.wire.commands()} == {(0.0, 0.0)}


async def test_the_signal_to_stop_does_the_same_at_once() -> None:
    async with bench() as b:
        await b.press("w")
        b.stop.set()
        await asyncio.sleep(INSTANT_S)
        assert b.velocity() == (0.0, 0.0)
        await b.ended()
        assert b.wire.alive() == []


async def test_the_end_of_the_keys_does_the_same_at_once() -> None:
    async with bench() as b:
        await b.press("w")
        b.keys.end()
        await asyncio.sleep(INSTANT_S)
        assert b.velocity() == (0.0, 0.0)
        await b.ended()
        assert b.wire.alive() == []


async def test_after_a_hang_there_is_no_burst_and_the_beat_goes_on_in_step() -> None:
    async with bench() as b:
        await asyncio.sleep(0.11)
        b.wire.said.clear()
        hang(3.0)
        await asyncio.sleep(INSTANT_S)
        assert len(b.wire.commands()) == 1
        await asyncio.sleep(0.1)
        assert [round(time_s - b.start_s, 2) for time_s, _ in b.wire.commands()][1:] == [3.15, 3.2]


async def test_after_a_hang_the_setpoint_is_zero_and_the_operator_is_informed() -> None:
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
        b.keys.press("s www a")
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


# --- keys that may be old


OLD = "ignored a key that was typed while the screen was not seen: the setpoint is zero"


@pytest.mark.parametrize("key", ["w", "s", "r", "?", "1", "enter"])
async def test_a_key_that_may_be_older_than_the_proof_of_the_screen_stops_and_has_no_other_effect(
    key: str,
) -> None:
    async with bench() as b:
        b.serve_reset(TriggerResponse(success=True, message="released"))
        await b.press("ww")
        b.keys.happen(KeyEvent(key, is_old=True))
        await asyncio.sleep(PERIOD_S)
        assert b.velocity() == (0.0, 0.0)
        assert b.screen.notes == [OLD]
        assert (b.view.level, b.view.help, b.resets) == (5, (), 0)
        await b.press("w")
        assert b.velocity() == (0.1, 0.0)


async def test_an_emergency_stop_and_a_quit_count_however_old_they_are() -> None:
    async with bench() as b:
        b.keys.happen(KeyEvent(" ", is_old=True), KeyEvent("q", is_old=True))
        await asyncio.sleep(INSTANT_S)
        assert b.wire.estops()
        await b.ended()


async def test_an_old_release_ends_the_motion_of_its_key() -> None:
    async with bench(_hold(reported=True, ramp=Ramp(1e6, 1e6)), Control.HOLD) as b:
        await b.press("i")
        assert b.velocity() == (0.5, 0.0)
        b.keys.happen(KeyEvent("i", KeyKind.RELEASE, is_old=True))
        await asyncio.sleep(INSTANT_S)
        assert (b.velocity(), b.screen.notes) == ((0.0, 0.0), [])


async def test_after_a_hang_keys_must_be_typed_on_a_later_picture() -> None:
    async with bench() as b:
        b.keys.happen(KeyEvent("r"))
        b.serve_reset(TriggerResponse(success=True, message="released"))
        hang(3.0)
        await asyncio.sleep(INSTANT_S)
        assert len(b.screen.doubted_s) == 1
        assert b.resets == 0, "r was typed during the hang"


@pytest.mark.parametrize("keys", ["", "w"])
async def test_keys_count_as_old_from_the_stop_for_a_stuck_screen_until_it_is_shown_again(keys: str) -> None:
    async with bench() as b:
        await b.press(keys)
        b.screen.stuck = True
        await asyncio.sleep(SCREEN_LIMIT_S - 0.1)
        assert b.screen.doubted_s == []
        await asyncio.sleep(2.0)
        assert len(b.screen.doubted_s) >= 15, "each picture that is not shown"
        b.screen.stuck = False
        healed_s = asyncio.get_running_loop().time()
        await asyncio.sleep(1.0)
        assert b.screen.doubted_s[-1] <= healed_s


# --- vigilance


DEMANDED = "no key for 10 s: press Enter to drive on"
UNANSWERED = "no key was pressed on demand: the setpoint is zero"
PICTURE_S = 0.1
"""The longest time between two looks at the clock."""


async def test_without_a_key_the_screen_asks_for_one_and_three_seconds_later_the_setpoint_is_zero() -> None:
    async with bench() as b:
        await b.press("ww")
        await asyncio.sleep(VIGILANCE_S - 2 * INSTANT_S)
        assert (b.screen.notes, b.screen.rang_s) == ([], [])
        await asyncio.sleep(PICTURE_S)
        assert (b.screen.notes, len(b.screen.rang_s)) == ([DEMANDED], 1)
        assert 2.8 < b.view.vigilance_left_s <= DEMAND_S
        await asyncio.sleep(DEMAND_S - 2 * PICTURE_S)
        assert b.velocity() == (0.2, 0.0)
        await asyncio.sleep(2 * PICTURE_S)
        assert b.velocity() == (0.0, 0.0)
        await asyncio.sleep(60.0)
        assert (b.velocity(), b.screen.notes, len(b.screen.rang_s)) == ((0.0, 0.0), [DEMANDED, UNANSWERED], 1)
        await b.press("w")
        assert b.velocity() == (0.1, 0.0)


@pytest.mark.parametrize("key", [PRESENCE_KEY, "a", "d", "1", "?", "r"])
async def test_any_key_that_counts_renews_vigilance_also_on_demand(key: str) -> None:
    async with bench() as b:
        b.serve_reset(TriggerResponse(success=False, message=""))
        await b.press("w")
        for wait_s in (VIGILANCE_S - 1.0, VIGILANCE_S + DEMAND_S - 0.5, VIGILANCE_S - 1.0):
            await asyncio.sleep(wait_s)
            b.keys.happen(KeyEvent(key))
            await asyncio.sleep(2 * PICTURE_S)
            assert b.velocity()[0] > 0.0
        assert [note for note in b.screen.notes if "key" in note] == [DEMANDED]


async def test_enter_does_nothing_but_renew() -> None:
    async with bench() as b:
        await b.press("wa")
        b.keys.happen(KeyEvent(PRESENCE_KEY))
        await asyncio.sleep(0.2)
        assert (b.velocity(), b.screen.notes) == ((0.1, 0.2), [])


@pytest.mark.parametrize("event", [KeyEvent(FOCUS_OUT), KeyEvent("w", KeyKind.RELEASE)])
async def test_an_event_that_is_no_press_of_a_key_does_not_renew_vigilance(event: KeyEvent) -> None:
    async with bench() as b:
        await b.press("w")
        for _ in range(14):
            await asyncio.sleep(1.0)
            b.keys.happen(event)
        assert b.velocity() == (0.0, 0.0)


async def test_a_robot_that_a_stop_holds_needs_a_key_too_because_it_could_drive_on() -> None:
    async with bench() as b:
        await b.press("w")
        b.tell(SafetyStatus.STOPPED, "OBSTACLE", causes=["OBSTACLE"])
        await asyncio.sleep(VIGILANCE_S + DEMAND_S + PICTURE_S)
        assert b.velocity() == (0.0, 0.0)


async def test_at_rest_no_key_is_demanded() -> None:
    async with bench() as b:
        await b.press("ws")
        await asyncio.sleep(60.0)
        assert (b.screen.notes, b.screen.rang_s) == ([], [])


async def test_a_held_key_and_a_gamepad_need_no_vigilance() -> None:
    async with bench(_hold(reported=True, ramp=Ramp(1e6, 1e6)), Control.HOLD) as b:
        b.keys.happen(KeyEvent("i", KeyKind.RELEASE))
        await b.press("i")
        await asyncio.sleep(60.0)
        assert (b.velocity(), b.screen.notes) == ((0.5, 0.0), [])
    stick = Stick()
    async with bench(stick, Control.GAMEPAD) as b:
        stick.at = Velocity(0.5)
        await asyncio.sleep(60.0)
        assert (b.velocity(), b.screen.notes) == ((0.5, 0.0), [])


# --- the reset


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
        await asyncio.sleep(RESET_TIMEOUT_S)
        assert "nobody answered" in b.screen.notes[0]
        assert not b.running.done()


async def test_a_slow_reset_does_not_delay_the_heartbeat() -> None:
    async with bench() as b:
        b.serve_reset(TriggerResponse(success=True, message="at last"), after_s=0.9)
        await b.press("rrr")
        await asyncio.sleep(1.0)
        assert [time_s for time_s, _ in b.wire.commands()] == on_the_beat(b, 21)
        assert (b.screen.notes, b.resets) == (["reset done: at last"], 1)


async def test_an_error_in_the_reset_ends_teleop_with_a_zero_and_without_token(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async with bench() as b:

        async def broken(*_: object, **__: object) -> TriggerResponse:
            raise RuntimeError("broken reset")

        monkeypatch.setattr(b.bus, "call", broken)
        await b.press("wr")
        assert b.velocity() == (0.0, 0.0)
        await b.ended()
        assert isinstance(b.running.exception(), RuntimeError)
        assert b.wire.alive() == []


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
        b.supervisor.send(topics.STATUS.key, b"\x00\x01", None)
        await asyncio.sleep(1.0)
        assert "silent" in b.screen.lines[-1]


# --- the ramp


def smooth() -> Incremental:
    return Incremental(Ramp(1.0, 4.0))


async def test_ten_presses_ramp_up_in_a_second_without_a_flood() -> None:
    async with bench(smooth()) as b:
        await b.press("w" * 10)
        assert 0.0 < b.velocity()[0] <= RAMP_PERIOD_S + 1e-9
        await asyncio.sleep(1.01)
        assert b.velocity() == (1.0, 0.0)
        speeds = [value[0] for _, value in b.wire.commands()]
        assert speeds == sorted(speeds)
        assert len(speeds) <= 1.01 / RAMP_PERIOD_S + 1.01 / PERIOD_S + 3


async def test_on_its_way_a_ramp_speaks_at_least_as_often_as_the_heartbeat() -> None:
    async with bench(smooth()) as b:
        await b.press("w" * 10)
        await asyncio.sleep(0.9)
        times = [time_s for time_s, _ in b.wire.commands()]
        assert max(later - earlier for earlier, later in pairwise(times)) <= PERIOD_S + 1e-4


@pytest.mark.parametrize("key", ["s", " ", "q", CTRL_Z])
async def test_no_stop_is_ramped(key: str) -> None:
    async with bench(smooth()) as b:
        await b.press("w" * 10)
        await asyncio.sleep(0.5)
        count = len(b.wire.commands())
        await b.press(key)
        assert b.wire.commands()[count:][0][1] == (0.0, 0.0)


async def test_a_lower_speed_level_cuts_what_is_asked_for_at_once() -> None:
    async with bench() as b:
        for _ in range(10):
            await b.press("w")
        await b.press("2")
        assert b.velocity() == (0.4, 0.0)


class Stick:
    """A pilot that ignores keys and never rests."""

    note, level, next_s, limit = "", 5, float("inf"), Velocity(1.0, 2.0)

    def __init__(self) -> None:
        self.at = NEUTRAL

    def on_key(self, event: KeyEvent, now_s: float) -> bool:
        return True

    def velocity(self, now_s: float) -> Velocity:
        return self.at

    def wanted(self) -> Velocity:
        return self.at

    def let_go(self) -> None:
        self.at = NEUTRAL


async def test_a_stick_that_speaks_a_thousand_times_a_second_does_not_flood_and_is_let_go_at_once() -> None:
    stick = Stick()
    async with bench(stick, Control.GAMEPAD) as b:
        for n in range(1, 500):
            stick.at = Velocity(n / 1000)
            b.wake.set()
            await asyncio.sleep(0.001)
        assert len(b.wire.commands()) <= 0.5 / MIN_GAP_S + 0.5 / PERIOD_S + 2
        stick.at = NEUTRAL
        b.wake.set()
        await asyncio.sleep(INSTANT_S)
        assert b.velocity() == (0.0, 0.0)


# --- the screen


async def test_pictures_fall_between_the_heartbeats() -> None:
    async with bench() as b:
        await asyncio.sleep(2.0)
        beats = [time_s for time_s, _ in b.wire.commands()]
        to_beat = [min(beat - drawn for beat in beats if beat > drawn) for drawn in b.screen.drawn_s[1:-1]]
        assert min(to_beat) > 0.02


async def test_a_key_just_before_a_heartbeat_is_drawn_after_it() -> None:
    async with bench() as b:
        await asyncio.sleep(
            b.wire.commands()[0][0] + 3 * PERIOD_S - asyncio.get_running_loop().time() - 0.001
        )
        drawn, beats = len(b.screen.drawn_s), len(b.wire.commands())
        b.keys.press("w")
        await asyncio.sleep(0.005)
        assert b.screen.drawn_s[drawn] >= b.wire.commands()[beats + 1][0]


async def test_the_bell_rings_at_the_edge_of_the_warning_and_then_only_while_it_closes() -> None:
    async with bench() as b:
        for n in range(100):  # ten seconds: clear, near, closing until the eighth, standing
            nearest_m = 0.5 - 0.02 * min(max(n - 20, 0), 60) / 10
            b.tell(SafetyStatus.DRIVING, warning=n >= 20, nearest_m=nearest_m)
            await asyncio.sleep(0.1)
        assert [round(time_s - b.start_s) for time_s in b.screen.rang_s] == [2, 4, 6, 8]


# --- one name, one program


async def test_a_second_teleop_is_shown_who_holds_the_name_and_disturbs_nobody() -> None:
    wire = Wire()
    async with bench(wire=wire) as first:
        await first.press("w")
        status = [source("teleop"), source("joy"), source("path")]
        first.tell(SafetyStatus.DRIVING, sources=status)
        said = len(wire.commands())
        async with bench(wire=wire) as second:
            second.tell(SafetyStatus.DRIVING, sources=status)
            error = second.running.exception()
            assert isinstance(error, HeldError)
            assert f"held by the teleop of {id(first)}" in str(error)
            assert "--view-only" in str(error)
        await asyncio.sleep(0.2)
        assert not first.running.done()
        assert wire.alive() == ["teleop"]
        assert {value for _, value in wire.commands()[said:]} == {(0.1, 0.0)}


@pytest.mark.parametrize("count", [2, 3, 5])
async def test_of_several_that_start_at_the_same_instant_exactly_one_drives(count: int) -> None:
    wire = Wire()
    made = [Bench(wire) for _ in range(count)]
    await asyncio.sleep(3.0)
    running = [b for b in made if not b.running.done()]
    assert (len(running), wire.alive()) == (1, ["teleop"])
    assert all(isinstance(b.running.exception(), HeldError) for b in made if b not in running)
    running[0].stop.set()
    await asyncio.wait({running[0].running})


async def test_of_two_candidates_the_smaller_mark_begins_once_the_other_has_given_way() -> None:
    wire = Wire()
    smaller = wire.open_joined("other").declare_alive("teleop.0")
    async with bench(wire=wire) as b:
        assert "at this very moment" in str(b.running.exception())
        assert (wire.commands(), wire.alive()) == ([], ["teleop.0"])
    smaller.withdraw()
    greater = wire.open_joined("other").declare_alive("teleop.z")
    wire.open_joined("other").declare_alive("teleop2.0")  # of another source
    made = Bench(wire)
    await asyncio.sleep(ASK_LIMIT_S + SILENT_LIMIT_S / 2)
    assert wire.commands() == []
    greater.withdraw()
    await made.started()
    assert sorted(wire.alive()) == ["teleop", "teleop2.0"]
    made.stop.set()
    await asyncio.wait({made.running})


async def test_a_holder_that_does_not_answer_is_waited_for_and_then_named_as_such() -> None:
    wire = Wire()
    wire.open_joined("other").declare_alive("teleop", RUN)  # and nobody who serves
    async with bench(wire=wire) as b:
        assert "held by a teleop that does not answer" in str(b.running.exception())
        assert (wire.commands(), wire.alive()) == ([], [])


async def test_a_stranger_with_the_token_of_a_source_keeps_nobody_from_driving_as_it() -> None:
    wire = Wire()
    wire.open_joined("other").declare_alive("teleop")
    made = Bench(wire)
    await made.started()
    made.stop.set()
    await asyncio.wait({made.running})
    assert made.running.exception() is None


async def test_the_token_of_a_program_that_has_just_died_is_waited_out() -> None:
    wire = Wire()
    token = wire.open_joined("other").declare_alive("teleop", RUN)
    made = Bench(wire)
    await asyncio.sleep(ASK_LIMIT_S + SILENT_LIMIT_S / 2)
    token.withdraw()
    await asyncio.sleep(ASK_LIMIT_S + 2 * POLL_S)
    assert not made.running.done()
    assert wire.alive() == ["teleop"]
    made.stop.set()
    await asyncio.wait({made.running})


async def test_keys_typed_before_the_name_is_ours_move_nothing_but_can_stop_and_quit() -> None:
    made = Bench()
    made.keys.press("ww www")
    await made.started()
    await asyncio.sleep(0.2)
    assert {value for _, value in made.wire.commands()} == {(0.0, 0.0)}
    assert made.wire.estops() != []
    made.keys.press("q")
    await asyncio.wait({made.running})
    hasty = Bench()
    hasty.keys.press("q")
    await asyncio.sleep(INSTANT_S)
    assert (hasty.running.done(), hasty.wire.commands(), hasty.wire.alive()) == (True, [], [])


async def test_a_rival_with_the_same_name_stops_this_one_and_is_reported_once() -> None:
    async with bench() as b:
        await b.press("w")
        joy = replace(source("joy"), refused_epoch=99)
        for refused in (0, 3, 6):
            b.tell(SafetyStatus.DRIVING, sources=[joy, replace(source("teleop"), refused_epoch=refused)])
            await asyncio.sleep(0.1)
        assert b.velocity() == (0.0, 0.0)
        assert [
            note for note in b.screen.notes if "another program publishes as teleop" in note
        ] == b.screen.notes


async def test_two_robots_with_one_namespace_are_not_driven_until_one_is_silent() -> None:
    async with bench() as b:
        robots = [b.supervisor.publisher(topics.STATUS) for _ in range(2)]
        ready = SafetyStatus(header("base_link", 0), mode=SafetyStatus.READY)
        await b.press("w")
        for _ in range(3):
            for robot in robots:
                robot.put(ready)
                await asyncio.sleep(0.05)
                await b.press("w")
        assert b.velocity() == (0.0, 0.0)
        assert ["two supervisors answer" in note for note in b.screen.notes] == [True]
        for _ in range(12):
            robots[0].put(ready)
            await asyncio.sleep(0.1)
        await b.press("w")
        assert b.velocity() == (0.1, 0.0)


async def test_a_supervisor_that_is_restarted_is_no_second_robot() -> None:
    async with bench() as b:
        for _ in range(3):
            robot = b.supervisor.publisher(topics.STATUS)
            for _ in range(5):
                robot.put(SafetyStatus(header("base_link", 0), mode=SafetyStatus.READY))
                await asyncio.sleep(0.1)
        await b.press("w")
        assert (b.velocity(), b.screen.notes) == ((0.1, 0.0), [])


class AnsweringSupervisor:
    """The supervisor's side of a link: ten times a second, its status reports the stamp of the newest command."""

    def __init__(self, wire: Wire, *, reports: bool = True) -> None:
        self._commands = wire.supervisor.subscribe(CMD_VEL)
        self._status = wire.supervisor.publisher(topics.STATUS)
        self._newest_ns = 0
        self._reports = reports
        self.speaks = True
        self._task = asyncio.create_task(self._run())

    async def _run(self) -> None:
        while True:
            await asyncio.sleep(0.1)
            command = self._commands.latest()
            if command is not None and command.stamp is not None:
                self._newest_ns = command.stamp.source_time_ns
            if self.speaks:
                self._say()

    def _say(self) -> None:
        times = [Time(*divmod(self._newest_ns, 10**9))] if self._reports else []
        self._status.put(
            SafetyStatus(
                header("base_link", 0),
                mode=SafetyStatus.READY,
                sources=[source("teleop")],
                source_times=times,
            )
        )

    def close(self) -> None:
        self._task.cancel()


@asynccontextmanager
async def linked(
    up_s: float, down_s: float, *, reports: bool = True, pilot: Pilot | None = None
) -> AsyncGenerator[tuple[Bench, AnsweringSupervisor]]:
    """A teleop whose link has had these delays from the start."""
    wire = Wire()
    for conditions, delay_s in zip(wire.link("teleop"), (up_s, down_s), strict=True):
        conditions.delay_s = delay_s
    async with bench(pilot, Control.INCREMENTAL if pilot is None else Control.HOLD, wire) as b:
        supervisor = AnsweringSupervisor(wire, reports=reports)
        await asyncio.sleep(3.0)
        try:
            yield b, supervisor
        finally:
            supervisor.close()


@pytest.mark.parametrize("delays_s", [(0.0, 0.0), (0.15, 0.15), (0.4, 0.0), (0.0, 0.4)])
async def test_motion_is_requested_over_a_link_within_the_limit(delays_s: tuple[float, float]) -> None:
    async with linked(*delays_s) as (b, _):
        await b.press("www")
        await asyncio.sleep(VIGILANCE_S - 1.0)
        assert b.velocity() == (pytest.approx(0.3), 0.0)
        assert b.screen.notes == []
        assert sum(delays_s) <= b.view.round_trip_s <= sum(delays_s) + PERIOD_S + INSTANT_S


@pytest.mark.parametrize("delays_s", [(0.7, 0.0), (0.0, 0.7), (0.3, 0.3), (2.0, 2.0)])
async def test_no_motion_is_requested_over_a_link_that_was_slow_from_the_start(
    delays_s: tuple[float, float],
) -> None:
    async with linked(*delays_s) as (b, _):
        await asyncio.sleep(3.0)
        for _ in range(3):
            await b.press("w")
            assert b.velocity() == (0.0, 0.0)
            await asyncio.sleep(0.5)
        assert {velocity for _, velocity in b.wire.commands()} == {(0.0, 0.0)}
        (note,) = b.screen.notes
        assert "the robot answers after" in note
        assert "the setpoint is zero" in note
        assert "LATE" in b.screen.lines[-1]
        await b.press(" ")
        assert b.wire.estops(), "the emergency stop is sent over any link"


async def test_a_link_that_becomes_slow_stops_the_robot_until_the_operator_requests_motion_again() -> None:
    async with linked(0.02, 0.02) as (b, _):
        await b.press("w")
        await asyncio.sleep(1.0)
        for conditions in b.wire.link("teleop"):
            conditions.delay_s = 0.4
        await asyncio.sleep(3.0)
        assert b.velocity() == (0.0, 0.0)
        for conditions in b.wire.link("teleop"):
            conditions.delay_s = 0.02
        await asyncio.sleep(2.0)
        assert b.velocity() == (0.0, 0.0), "it does not start by itself"
        await b.press("w")
        assert b.velocity() == (0.1, 0.0)
        assert len(b.screen.notes) == 1


async def test_a_cut_link_sends_no_neutral_by_itself_after_its_return() -> None:
    async with linked(0.02, 0.02) as (b, _):
        await b.press("w")
        await asyncio.sleep(1.0)
        b.wire.cut("teleop")
        await asyncio.sleep(3.0)
        b.wire.heal("teleop")
        await asyncio.sleep(3.0)
        assert (b.velocity(), b.screen.notes) == ((0.1, 0.0), [])


async def test_a_silence_of_the_supervisor_sends_no_neutral_which_would_arm_the_robot_again() -> None:
    async with linked(0.0, 0.0) as (b, supervisor):
        await b.press("w")
        supervisor.speaks = False
        await asyncio.sleep(VIGILANCE_S - 1.0)
        assert (b.velocity(), b.screen.notes) == ((0.1, 0.0), [])


REPEAT_S = 0.033


def _hold(*, reported: bool, ramp: Ramp) -> Hold:
    pilot = Hold(Velocity(0.5, 1.0), Velocity(1.0, 2.0), ramp)
    pilot.rely_on_releases(reported=reported)
    return pilot


async def _hold_key(b: Bench, seconds: float, *, reported: bool) -> None:
    for _ in range(round(seconds / REPEAT_S)):
        b.keys.happen(KeyEvent("i", KeyKind.REPEAT if reported else KeyKind.PRESS))
        await asyncio.sleep(REPEAT_S)


@pytest.mark.parametrize("reported", [True, False])
@pytest.mark.parametrize("acceleration", [1.0, 1e6])
async def test_over_a_slow_link_a_held_key_requests_no_motion(*, reported: bool, acceleration: float) -> None:
    pilot = _hold(reported=reported, ramp=Ramp(acceleration, acceleration))
    async with linked(0.4, 0.4, pilot=pilot) as (b, _):
        b.keys.happen(KeyEvent("i"))
        await _hold_key(b, 2.0, reported=reported)
        assert {velocity for _, velocity in b.wire.commands()} == {(0.0, 0.0)}
        assert len(b.screen.notes) == 1


@pytest.mark.parametrize("reported", [True, False])
async def test_a_key_that_is_held_through_a_slow_phase_does_not_move_the_robot_afterwards(
    *, reported: bool
) -> None:
    async with linked(0.02, 0.02, pilot=_hold(reported=reported, ramp=Ramp(1.0, 1.0))) as (b, _):
        b.keys.happen(KeyEvent("i"))
        await _hold_key(b, 1.0, reported=reported)
        assert b.velocity()[0] > 0.0
        for delay_s in (0.4, 0.02):
            for conditions in b.wire.link("teleop"):
                conditions.delay_s = delay_s
            await _hold_key(b, 3.0, reported=reported)
            assert b.velocity() == (0.0, 0.0)
        b.keys.happen(KeyEvent("i", KeyKind.RELEASE))
        await asyncio.sleep(0.3)
        b.keys.happen(KeyEvent("i"))
        await _hold_key(b, 0.3, reported=reported)
        assert b.velocity()[0] > 0.0, "the key was pressed again"


async def test_before_the_first_status_no_motion_is_requested() -> None:
    b = Bench()
    while not b.screen.lines:  # noqa: ASYNC110 - the first picture is no event
        await asyncio.sleep(INSTANT_S)
    await asyncio.sleep(3.0)
    await b.press("w")
    await asyncio.sleep(1.0)
    assert {velocity for _, velocity in b.wire.commands()} == {(0.0, 0.0)}
    b.tell(SafetyStatus.READY)
    await asyncio.sleep(PERIOD_S)
    await b.press("w")
    assert b.velocity() == (0.1, 0.0)
    b.stop.set()
    await b.ended()


@pytest.mark.parametrize("gap_s", [0.0, 0.01, 0.1, 0.3])
async def test_an_emergency_stop_after_a_reset_is_the_last_word(gap_s: float) -> None:
    """The reset clears the latch 0.2 s after it was requested; statuses show the latch until then."""
    async with bench() as b:
        pressed, latched = b.supervisor.subscribe(topics.ESTOP), True

        async def reset(_: str) -> TriggerResponse:
            nonlocal latched
            await asyncio.sleep(0.2)
            pressed.take()
            latched = False
            return TriggerResponse(success=True, message="")

        b.supervisor.serve(topics.SUPERVISOR_RESET, reset)
        b.keys.press("r")
        if gap_s:
            await asyncio.sleep(gap_s)
        b.keys.press(" ")
        for _ in range(30):
            latched = latched or pressed.latest() is not None
            b.tell(SafetyStatus.STOPPED, *(["ESTOP"] if latched else ["NO_COMMAND"]))
            await asyncio.sleep(0.1)
        assert latched
        assert b.wire.estops()[-1] < asyncio.get_running_loop().time() - 1.0, "it is not repeated for ever"


async def test_with_an_older_supervisor_that_reports_no_stamps_teleop_drives_as_before() -> None:
    async with linked(0.7, 0.0, reports=False) as (b, _):
        await b.press("w")
        assert (b.velocity(), b.screen.notes) == ((0.1, 0.0), [])


async def test_a_teleop_that_is_refused_although_nobody_else_is_heard_begins_anew_at_zero() -> None:
    async with bench() as b:
        for refused in range(6):
            await b.press("w")
            b.tell(SafetyStatus.STOPPED, sources=[replace(source("teleop"), refused_epoch=refused)])
            await asyncio.sleep(0.1)
        assert b.velocity() == (0.0, 0.0)
        assert len(b.wire.epochs) == 2
        assert "starts again" in b.screen.notes[-1]
        for _ in range(6):
            b.tell(SafetyStatus.READY, sources=[replace(source("teleop"), refused_epoch=5)])
            await asyncio.sleep(0.1)
        await b.press("w")
        assert (b.velocity(), len(b.wire.epochs)) == ((0.1, 0.0), 2)


# --- suspended


async def test_ctrl_z_suspends_after_a_zero_and_without_the_token_and_comes_back_neutral() -> None:
    async with bench() as b:
        await b.press("w")
        seen: list[tuple[object, list[str]]] = []
        b.screen.on_suspend = lambda: (seen.append((b.velocity(), list(b.bus.own))), hang(5.0))[0]
        await b.press(CTRL_Z + "w")
        await asyncio.sleep(7.0)
        assert seen == [((0.0, 0.0), [])]
        assert (b.wire.alive(), b.velocity(), b.running.done()) == (["teleop"], (0.0, 0.0), False)
        assert b.screen.notes == ["back again: the setpoint is zero"]
        await b.press("w")
        assert b.velocity() == (0.1, 0.0)


async def test_who_comes_back_and_finds_the_name_taken_gives_way() -> None:
    wire = Wire()
    async with bench(wire=wire) as b:
        await b.press(CTRL_Z)
        async with bench(wire=wire) as other:
            await asyncio.sleep(ASK_LIMIT_S + 1.0)
            assert sorted(running.done() for running in (b.running, other.running)) == [False, True]
            assert wire.alive() == ["teleop"]


# --- looking on


async def test_who_looks_on_commands_nothing_and_holds_no_name() -> None:
    wire = Wire()
    async with bench(wire=wire) as driver, bench(control=Control.VIEW_ONLY, wire=wire) as viewer:
        driver.serve_reset(TriggerResponse(success=True, message="released"))
        said = len(wire.commands())
        await viewer.press("wwxadsr")
        await asyncio.sleep(0.12)
        assert len(wire.commands()) - said <= 3  # the driver's own heartbeat
        assert (wire.alive(), driver.resets) == (["teleop"], 0)
        await viewer.press("q")
        assert viewer.running.done()
        assert wire.alive() == ["teleop"]


async def test_the_emergency_stop_is_anybodys_right() -> None:
    async with bench(control=Control.VIEW_ONLY) as viewer:
        await viewer.press(" ")
        assert len(viewer.wire.estops()) == 1
        assert viewer.wire.commands() == []


async def test_a_key_release_reaches_the_pilot_and_is_no_command() -> None:
    async with bench() as b:
        b.keys.happen(KeyEvent("q", KeyKind.RELEASE), KeyEvent(" ", KeyKind.RELEASE))
        await asyncio.sleep(INSTANT_S)
        assert not b.running.done()
        assert b.wire.estops() == []


@pytest.mark.parametrize(
    ("key", "shown"),
    [
        ("^", "ignored ^, which has no function: the setpoint is zero"),
        ("\xb4", "ignored acute accent, which has no function: the setpoint is zero"),
        ("up", "ignored up, which has no function: the setpoint is zero"),
        (PASTED, "ignored pasted text: the setpoint is zero"),
        (SEVERAL, "ignored different keys at once: the setpoint is zero"),
    ],
)
async def test_a_key_without_a_function_stops_at_once_and_is_shown_with_the_reason(
    key: str, shown: str
) -> None:
    async with bench() as b:
        await b.press("w")
        assert b.velocity() == (0.1, 0.0)
        b.keys.happen(KeyEvent(key))
        await asyncio.sleep(INSTANT_S)
        assert b.velocity() == (0.0, 0.0)
        assert b.screen.notes[-1] == shown
        assert b.wire.estops() == []
        await b.press("w")
        await asyncio.sleep(MIN_GAP_S)
        assert b.velocity() == (0.1, 0.0)


async def test_ignored_keys_are_shown_at_most_once_in_a_second() -> None:
    async with bench() as b:
        await b.press("^^~")
        b.keys.happen(KeyEvent("~", KeyKind.REPEAT), KeyEvent("~", KeyKind.RELEASE))
        await asyncio.sleep(IGNORED_PERIOD_S - 0.1)
        await b.press("~")
        assert [note for note in b.screen.notes if "ignored" in note] == [
            "ignored ^, which has no function: the setpoint is zero"
        ]
        await asyncio.sleep(0.1)
        await b.press("~")
        assert b.screen.notes[-1] == "ignored ~, which has no function: the setpoint is zero"


async def test_a_viewer_shows_a_key_without_a_function_too() -> None:
    async with bench(control=Control.VIEW_ONLY) as viewer:
        await viewer.press("w")
        assert viewer.screen.notes[-1] == "ignored w, which has no function"


# --- the help


@pytest.mark.parametrize("key", ["?", "h", "H"])
async def test_a_key_opens_and_closes_the_help(key: str) -> None:
    async with bench() as b:
        await b.press(key)
        await asyncio.sleep(PERIOD_S)
        assert b.view.help == key_help(Control.INCREMENTAL)
        await b.press(key)
        await asyncio.sleep(PERIOD_S)
        assert b.view.help == ()


async def test_a_held_key_opens_the_help_once() -> None:
    async with bench() as b:
        kinds = (KeyKind.PRESS, KeyKind.REPEAT, KeyKind.REPEAT, KeyKind.REPEAT, KeyKind.RELEASE)
        b.keys.happen(*(KeyEvent("?", kind) for kind in kinds))
        await asyncio.sleep(PERIOD_S)
        assert b.view.help


async def test_the_heartbeat_is_the_same_with_the_help_open_and_the_keys_act() -> None:
    async def commands(keys: str) -> list[tuple[float, tuple[float, float]]]:
        async with bench() as b:
            await b.press("ww")
            await asyncio.sleep(0.02)
            await b.press(keys)
            await asyncio.sleep(1.0)
            await b.press("a")
            await asyncio.sleep(0.1)
            return [(round(at_s - b.start_s, 4), value) for at_s, value in b.wire.commands()]

    plain, helped = await commands("5"), await commands("?")
    assert helped == plain
    assert helped[-1][1] == (0.2, 0.2)


async def test_the_emergency_stop_works_with_the_help_open_which_stays_beside_the_state() -> None:
    async with bench() as b:
        await b.press("ww?")
        await b.press(" ")
        b.tell(SafetyStatus.STOPPED, "ESTOP")
        await asyncio.sleep(0.15)
        assert b.velocity() == (0.0, 0.0)
        assert len(b.wire.estops()) >= 1
        assert b.view.help
        assert "STOPPED: ESTOP" in b.screen.lines[-1]


async def test_in_hold_mode_the_question_mark_stops_like_any_other_key_and_h_opens_no_help() -> None:
    pilot = Hold(Velocity(0.5, 1.0), Velocity(1.0, 2.0), Ramp(1e6, 1e6))
    pilot.rely_on_releases(reported=True)
    async with bench(pilot, Control.HOLD) as b:
        await b.press("i")
        assert b.velocity() == (0.5, 0.0)
        await b.press("h")
        assert (b.velocity(), b.view.help) == ((0.0, 0.0), ())
        await b.press("i")
        await b.press("?")
        await asyncio.sleep(PERIOD_S)
        assert b.velocity() == (0.0, 0.0)
        assert b.view.help == key_help(Control.HOLD)


async def test_a_viewer_has_the_help_too() -> None:
    async with bench(control=Control.VIEW_ONLY) as b:
        await b.press("?")
        await asyncio.sleep(PERIOD_S)
        assert b.view.help == key_help(Control.VIEW_ONLY)
        assert b.view.limit is None


async def test_the_display_of_one_line_prints_the_keys_and_the_speed_level() -> None:
    async with bench(pictures=False) as b:
        await b.press("?")
        assert b.screen.notes == [
            *help_lines(key_help(Control.INCREMENTAL)),
            "speed level 5: up to 1.00 m/s, 2.00 rad/s; each press: 0.10 m/s or 0.20 rad/s",
        ]
        await b.press("3w3")
        assert b.screen.notes[-1] == (
            "speed level 3: up to 0.60 m/s, 1.20 rad/s; each press: 0.06 m/s or 0.12 rad/s"
        )
        assert len([note for note in b.screen.notes if note.startswith("speed level 3")]) == 1
        assert b.view.help == ()


async def test_a_viewer_with_one_line_prints_only_the_keys() -> None:
    async with bench(control=Control.VIEW_ONLY, pictures=False) as b:
        await b.press("h")
        assert b.screen.notes == help_lines(key_help(Control.VIEW_ONLY))


async def test_a_change_of_level_is_shown_at_the_next_picture() -> None:
    async with bench() as b:
        await b.press("2")
        await asyncio.sleep(PERIOD_S)
        assert (b.view.level, b.view.limit) == (2, Velocity(0.4, 0.8))
        assert b.screen.notes == []


# --- the stops


async def test_each_stop_is_an_event_with_its_cause_and_one_that_comes_and_goes_is_one_event() -> None:
    async with bench() as b:
        for mode, causes in ((SafetyStatus.STOPPED, ["OBSTACLE"]), (SafetyStatus.LIMITED, [])) * 3:
            b.tell(mode, *causes, causes=causes, nearest_m=0.3, nearest_bearing_rad=0.0)
            await asyncio.sleep(0.5)
        b.tell(SafetyStatus.STOPPED, "OVERRUN", "NO_COMMAND", causes=["OVERRUN", "NO_COMMAND"])
        await asyncio.sleep(0.1)
        obstacle, overrun = b.screen.notes
        assert obstacle.startswith("stopped: ")
        assert "0.30 m ahead" in obstacle
        assert overrun == "stopped: the supervisor was late, or its machine was suspended"


@pytest.mark.parametrize("control", [Control.INCREMENTAL, Control.VIEW_ONLY])
async def test_an_estop_from_elsewhere_is_an_event_that_says_whose_it_was(control: Control) -> None:
    async with bench(control=control) as b:
        by = "pressed by door, 2026-11-26 14:20:05"
        b.tell(SafetyStatus.STOPPED, "ESTOP", causes=["ESTOP"], detail=by)
        await asyncio.sleep(0.1)
        assert b.screen.notes[-1] == f"stopped: the emergency stop is latched: {by}"


async def test_the_own_estop_is_one_event() -> None:
    async with bench() as b:
        await b.press(" ")
        b.tell(SafetyStatus.STOPPED, "ESTOP", causes=["ESTOP"], detail="pressed by teleop")
        await asyncio.sleep(0.3)
        b.tell(SafetyStatus.STOPPED, "ESTOP", causes=["ESTOP"], detail="pressed by teleop")
        await asyncio.sleep(0.3)
        assert b.screen.notes == ["emergency stop"]
