"""E-stop stations as real processes: death, silence, replays, presses, the terminal, and a restart of the supervisor."""

import asyncio
import signal
import struct
import subprocess
import sys
import time
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
import zenoh

from tests.system.harness import DRIVE_TRIES, PATIENCE_S, Robot, is_zero, patiently, robot
from tests.system.operators import Operator, until
from tests.system.ports import free_endpoint, participants
from tests.system.process_state import state_of
from tests.system.rogue import open_rogue
from wire import topics
from wire.lease import LEASE_S

pytestmark = pytest.mark.timeout(180)

LIFELINE = str(Path(sys.executable).with_name("lifeline"))
CONFIG = Path(__file__).parents[2] / "deploy" / "robot.toml"
LOST, ESTOP = "ESTOP_STATION_LOST", "ESTOP"
CTRL_R = b"\x12"
LATE_S = 0.3
"""How late a process may be beside other tests."""
GOODBYE_S = PATIENCE_S / DRIVE_TRIES
"""Time for a goodbye in one of several attempts. A delayed supervisor considers the station lost before it leaves."""
KEY = "robot/estop_station/door"


def say(text: str) -> None:
    print(f"\n    measured: {text}")


def config_with(tmp_path: Path, **required: bool) -> Path:
    tables = "".join(
        f'\n[[supervisor.estop_stations]]\nname = "{name}"\nrequired = {str(value).lower()}\n'
        for name, value in required.items()
    )
    path = tmp_path / "robot.toml"
    path.write_text(CONFIG.read_text() + tables)
    return path


@asynccontextmanager
async def site(tmp_path: Path, **required: bool) -> AsyncGenerator[Robot]:
    config = config_with(tmp_path, **(required or {"door": True}))
    async with robot(tmp_path, config=config) as subject:
        yield subject


@asynccontextmanager
async def station(
    endpoint: str, name: str = "door", *, term: str = "xterm-256color"
) -> AsyncGenerator[Operator]:
    made = Operator(LIFELINE, "estop", "--name", name, "--endpoint", endpoint, term=term)
    try:
        yield made
    finally:
        made.close()


def state(subject: Robot, name: str = "door") -> str:
    return next((one.words() for one in subject.status.estop_stations if one.name == name), "none")


async def heard(subject: Robot, name: str = "door") -> None:
    await subject.until(lambda: state(subject, name) == "heard", f"{name} is heard")


async def reset(subject: Robot) -> None:
    await subject.press("sr", lambda: not {LOST, ESTOP} & set(subject.status.causes), "a reset")


async def drive(subject: Robot, name: str = "door", *, keys: str = "wwwww", speed_m_s: float = 0.5) -> None:
    """Drive; on a busy machine, a late station may have been lost, and then the operator resets first."""

    async def attempt() -> None:
        await heard(subject, name)
        if {LOST, ESTOP} & set(subject.status.causes):
            await reset(subject)
        subject.type("s")
        await subject.ready(5.0)
        subject.type(keys)
        await subject.until_it_drives(speed_m_s)

    await subject.connected()
    await patiently(attempt)


async def refused(subject: Robot, reason: str) -> None:
    """Reset with a neutral teleop until it is refused for this reason; on a busy machine, another one may come first."""
    await subject.press("s", lambda: subject.status.sources[0].neutral, "a neutral teleop")
    async with asyncio.timeout(PATIENCE_S):
        while reason not in (reply := await subject.answer_to_reset()).message:
            assert not reply.success


@pytest.mark.timed
async def test_a_killed_station_stops_the_robot_at_once_and_a_new_one_with_a_reset_lets_it_drive(
    tmp_path: Path,
) -> None:
    async with site(tmp_path) as subject:
        for _ in range(3):
            async with station(subject.endpoint) as door:
                await drive(subject)
                killed_s = time.monotonic()
                door.process.kill()
                to_zero_s = await subject.zero_after(killed_s)
                await subject.until(lambda: LOST in subject.status.causes, LOST)
                say(f"SIGKILL of a station to zero on cmd_vel: {to_zero_s * 1e3:.1f} ms")
                assert to_zero_s < 0.1, "its silence stopped it, not its token"
            await refused(subject, "the required e-stop station door is not heard: start it first")


@pytest.mark.timed
async def test_a_stopped_station_stops_the_robot_within_its_lease(tmp_path: Path) -> None:
    async with site(tmp_path) as subject, station(subject.endpoint) as door:
        await heard(subject)
        await drive(subject)
        stopped_s = time.monotonic()
        door.send(signal.SIGSTOP)
        await until(lambda: state_of(door.process.pid) == "T")
        to_zero_s = await subject.zero_after(stopped_s)
        say(f"SIGSTOP of a station to zero on cmd_vel: {to_zero_s * 1e3:.1f} ms")
        assert to_zero_s < LEASE_S + LATE_S
        await subject.until(lambda: subject.status.detail == "door is silent", "the detail")
        door.send(signal.SIGCONT)
        await heard(subject)
        await subject.never(lambda: LOST not in subject.status.causes, "cleared without a reset", 0.5)
        await until(lambda: "the robot is stopped: ESTOP_STATION_LOST" in door.picture)
        await reset(subject)
        await drive(subject)


async def test_a_replay_of_recorded_presence_by_another_client_proves_nothing(tmp_path: Path) -> None:
    async with site(tmp_path) as subject:
        rogue = open_rogue(participants(subject.endpoint))
        try:
            recorded: list[tuple[bytes, bytes | None]] = []

            def record(sample: zenoh.Sample) -> None:
                attachment = sample.attachment
                recorded.append(
                    (sample.payload.to_bytes(), None if attachment is None else attachment.to_bytes())
                )

            tape = rogue.declare_subscriber(
                f"{KEY}/presence", zenoh.handlers.Callback(record, indirect=False)
            )
            async with station(subject.endpoint) as door:
                await heard(subject)
                await until(lambda: len(recorded) > 40)
                door.process.kill()
                await subject.until(lambda: state(subject) == "lost", "its loss")
            tape.undeclare()
            messages = list(recorded)
            for payload, attachment in messages * 2:
                rogue.put(f"{KEY}/presence", payload, attachment=attachment)
                await asyncio.sleep(0.02)
                subject.look()
                assert state(subject) == "lost"
            await refused(subject, "is not heard")
        finally:
            rogue.close()  # pyright: ignore[reportUnknownMemberType]


@pytest.mark.smoke
async def test_any_zenoh_client_can_be_a_station(tmp_path: Path) -> None:
    """With no code of this project: it answers each challenge with 18 bytes of CDR."""
    async with site(tmp_path) as subject:
        rogue = open_rogue(participants(subject.endpoint))
        try:
            layout, header_bytes = struct.Struct("<QQ??"), b"\x00\x01\x00\x00"
            answered: list[int] = []
            pressed = False

            def answer(sample: zenoh.Sample) -> None:
                challenge, response, _, _ = layout.unpack(sample.payload.to_bytes()[4:])
                answered.append(response)
                message = layout.pack(1000 + len(answered), challenge, pressed, False)  # noqa: FBT003
                rogue.put(f"{KEY}/presence", header_bytes + message)

            listener = rogue.declare_subscriber(
                f"{KEY}/challenge", zenoh.handlers.Callback(answer, indirect=False)
            )
            await heard(subject)
            assert subject.status.estop_stations[0].required
            await until(lambda: answered[-1] > 1000)
            await drive(subject)
            pressed = True
            await subject.until(lambda: ESTOP in subject.status.causes, "its press")
            await refused(subject, "the e-stop station door is pressed: release it there first")
            pressed = False
            await subject.until(lambda: state(subject) == "heard", "its release")
            await reset(subject)
            listener.undeclare()
            await subject.until(lambda: LOST in subject.status.causes, "its silence")
        finally:
            rogue.close()  # pyright: ignore[reportUnknownMemberType]


@pytest.mark.timed
async def test_any_key_stops_and_only_the_release_of_the_button_permits_the_reset(tmp_path: Path) -> None:
    async with site(tmp_path) as subject, station(subject.endpoint) as door:
        await heard(subject)
        await until(lambda: "door: HEARD - any key stops the robot" in door.picture)
        await drive(subject)
        pressed_s = time.monotonic()
        door.type(b"k")
        to_zero_s = await subject.zero_after(pressed_s)
        say(f"a key at a station to zero on cmd_vel: {to_zero_s * 1e3:.1f} ms")
        assert to_zero_s < 0.1 + LATE_S
        await until(lambda: "door: STOPPED - pressed here: release it" in door.picture)
        await refused(subject, "the e-stop station door is pressed: release it there first")
        door.type(CTRL_R)
        await subject.until(lambda: state(subject) == "heard", "its release")
        await reset(subject)
        await until(lambda: "door: HEARD" in door.picture)
        await drive(subject)


@pytest.mark.timed  # a late process may lose its presence
async def test_one_lost_station_of_two_stops_the_robot(tmp_path: Path) -> None:
    async with (
        site(tmp_path, door=True, hall=True, gate=False) as subject,
        station(subject.endpoint) as door,
        station(subject.endpoint, "hall") as hall,
        station(subject.endpoint, "gate") as gate,
    ):
        for name in ("door", "hall", "gate"):
            await heard(subject, name)
        await drive(subject)
        gate.process.kill()
        await subject.until(lambda: state(subject, "gate") == "lost", "the loss of the gate")
        await subject.never(lambda: LOST in subject.status.causes, "gate is not required", 0.5)
        hall.process.kill()
        await subject.until(lambda: subject.status.detail == "hall is silent", "the loss of the hall")
        await until(lambda: "the robot is stopped" in door.picture)
        await refused(subject, "station hall is not heard")


async def test_a_station_that_leaves_says_that_it_stops_the_robot(tmp_path: Path) -> None:
    async with site(tmp_path) as subject:

        async def attempt() -> None:
            async with station(subject.endpoint) as door:
                await heard(subject)
                await until(lambda: "Leaving stops the robot" in door.picture)
                await drive(subject)
                door.type(b"q")
                assert await door.ended() == (0, "")
                await subject.until(
                    lambda: subject.status.detail == "door has left", "its goodbye", GOODBYE_S
                )
                says = "has left: the robot stops, because this station is required"
                await subject.until(lambda: says in door.output, says, GOODBYE_S)
                await until(lambda: door.is_restored)

        await patiently(attempt)


async def test_a_supervisor_that_is_killed_during_the_latch_starts_latched(tmp_path: Path) -> None:
    config = config_with(tmp_path, door=True)
    async with robot(tmp_path, config=config) as subject:
        async with station(subject.endpoint) as door:
            await heard(subject)
            await drive(subject)
            door.process.kill()
            await subject.until(
                lambda: LOST in subject.status.causes and not subject.status.estop_record_problem, "a record"
            )
        subject.restart_supervisor("--config", str(config))
        await subject.until(lambda: {ESTOP, LOST} <= set(subject.status.causes), "both reasons")
        await subject.until(lambda: any(s.accepted for s in subject.status.sources), "commands")
        await refused(subject, "is not heard")
        async with station(subject.endpoint):
            await heard(subject)
            await subject.never(lambda: ESTOP not in subject.status.causes, "released without a reset", 0.5)
            await reset(subject)
            await drive(subject)
            # A restart without a latch needs no reset: the station is heard again, and a neutral arms.
            subject.restart_supervisor("--config", str(config))
            await heard(subject)
            await drive(subject)


# --- the terminal


@pytest.mark.smoke
async def test_before_the_supervisor_runs_the_station_is_not_heard_and_keeps_a_press(tmp_path: Path) -> None:
    config, endpoint = config_with(tmp_path, door=True), free_endpoint()
    async with station(endpoint) as door:
        waits = f"door: NOT HEARD - waiting for the supervisor at {endpoint}"
        await until(lambda: waits in door.picture and "█" in door.picture)
        door.type(b" ")
        await until(lambda: "PRESSED, not confirmed" in door.picture)
        subject = Robot(endpoint, tmp_path)
        try:
            subject.start(topics.SUPERVISOR, "--config", str(config))
            await subject.observe()
            await subject.until(lambda: ESTOP in subject.status.causes, "the kept press")
            await until(lambda: "door: STOPPED - pressed here: release it" in door.picture)
        finally:
            await subject.close()
        await until(lambda: "door: NOT HEARD" in door.picture)


async def test_a_small_terminal_shows_how_to_stop_and_a_dumb_one_the_whole_sentence() -> None:
    endpoint = free_endpoint()
    async with station(endpoint) as small, station(endpoint, term="dumb") as dumb:
        for one in (small, dumb):
            one.resize(40, 10)
        await until(lambda: "SPACE or any key: STOP" in small.picture and "█" not in small.picture)
        dumb.type(b" ")
        wanted = f"door: NOT HEARD - PRESSED, not confirmed; waiting for the supervisor at {endpoint}"
        await until(lambda: wanted in dumb.output)


async def test_a_station_that_is_not_configured_says_so_and_that_its_key_has_stopped_the_robot(
    tmp_path: Path,
) -> None:
    async with (
        robot(tmp_path, topics.SUPERVISOR, teleop=False) as subject,
        station(subject.endpoint, "window") as window,
    ):
        await until(lambda: "the supervisor has no station window" in window.picture)
        window.type(b" ")
        await subject.until(lambda: ESTOP in subject.status.causes, "its press, by estop")
        await until(lambda: "pressed, and the robot is stopped; the supervisor has no" in window.picture)


@pytest.mark.timed  # a late process may lose its presence
async def test_a_second_program_of_one_name_stops_the_robot_by_its_key_but_not_by_leaving(
    tmp_path: Path,
) -> None:
    config = config_with(tmp_path, door=True)
    async with (
        robot(tmp_path, topics.SUPERVISOR, teleop=False, config=config) as subject,
        station(subject.endpoint) as door,
    ):
        await heard(subject)
        await until(lambda: "Leaving stops the robot" in door.picture)
        async with station(subject.endpoint) as second:
            await until(lambda: "another program is the station door" in second.picture)
            assert "Leaving stops the robot" not in second.picture
            second.type(b" ")
            await until(lambda: "pressed, and the robot is stopped; another program" in second.picture)
            await subject.until(lambda: ESTOP in subject.status.causes, "its press")
            second.type(b"q")
            assert await second.ended() == (0, "")
            assert "e-stop station door has left; it was not heard" in second.output
        await heard(subject)  # the second's press is shown until the first sends its own released button
        await subject.never(lambda: state(subject) != "heard", "the end of the first", 0.5)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
async def test_a_signal_ends_the_station_with_a_goodbye_and_restores_the_terminal(
    tmp_path: Path, number: signal.Signals
) -> None:
    config = config_with(tmp_path, door=True)
    async with robot(tmp_path, topics.SUPERVISOR, teleop=False, config=config) as subject:

        async def attempt() -> None:
            async with station(subject.endpoint) as door:
                await heard(subject)
                door.send(number)
                assert await door.ended() == (0, "")
                await subject.until(lambda: state(subject) == "has left", "its goodbye", GOODBYE_S)
                await until(lambda: door.is_restored)

        await patiently(attempt)


async def test_a_closed_terminal_ends_the_station_and_the_robot_stops(tmp_path: Path) -> None:
    async with site(tmp_path) as subject, station(subject.endpoint) as door:
        await heard(subject)
        await drive(subject)
        door.hang_up()
        await subject.until(lambda: LOST in subject.status.causes, "its end")
        await until(lambda: door.process.poll() is not None)


@pytest.mark.timed  # a late process may lose its presence
async def test_a_terminal_that_accepts_no_output_neither_ends_the_presence_nor_the_button(
    tmp_path: Path,
) -> None:
    async with site(tmp_path) as subject, station(subject.endpoint) as door:
        await heard(subject)
        await drive(subject)
        door.look(at=False)
        for size in (
            100,
            101,
        ) * 200:  # each makes it draw everything again, until the terminal's buffer is full
            door.resize(size, 30)
            door.send(signal.SIGWINCH)
            await asyncio.sleep(0.005)
        await subject.never(lambda: LOST in subject.status.causes, "stopped by its display", 1.0)
        door.type(b" ")
        await subject.until(lambda: ESTOP in subject.status.causes, "a press")
        door.look(at=True)
        await until(lambda: "door: STOPPED" in door.picture)


def refusal_of(*command: str) -> str:
    """Run a command without a terminal, and return the sentence with which it refuses."""
    ended = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout) == (2, "")
    (sentence,) = ended.stderr.splitlines()
    return sentence


def test_without_a_terminal_a_station_says_so_in_one_sentence() -> None:
    sentence = refusal_of(LIFELINE, "estop", "--name", "door")
    assert sentence.startswith("lifeline: an e-stop station needs a terminal on standard input and output")


def test_a_name_that_no_configuration_accepts_is_refused_in_one_sentence() -> None:
    sentence = refusal_of(LIFELINE, "estop", "--name", "front door")
    assert sentence.startswith("lifeline: 'front door' is not a name")


async def test_one_press_from_the_command_line_is_confirmed(tmp_path: Path) -> None:
    endpoint = free_endpoint()
    nobody = await asyncio.create_subprocess_exec(
        LIFELINE, "estop", "--endpoint", endpoint, stderr=asyncio.subprocess.PIPE
    )
    _, errors = await nobody.communicate()
    assert nobody.returncode == 3
    assert errors.decode() == (
        f"lifeline: NOT stopped: no supervisor answers at {endpoint}; a base whose supervisor is silent brakes by "
        "itself. If the robot moves, stop it by other means: its own button, its power\n"
    )
    async with robot(tmp_path) as subject:
        await subject.drive()

        async def attempt() -> None:
            """It is confirmed within a second, or not at all."""
            press = await asyncio.create_subprocess_exec(
                LIFELINE, "estop", "--endpoint", subject.endpoint, stdout=asyncio.subprocess.PIPE
            )
            answer, _ = await press.communicate()
            assert press.returncode == 0
            assert "the emergency stop is latched" in answer.decode()

        await patiently(attempt)
        await subject.until(lambda: ESTOP in subject.status.causes, "the press")
        await subject.until(lambda: is_zero(subject.outputs[-1][1]), "zero")
