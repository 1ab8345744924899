"""What a stranger on the network can pretend: the tokens of others, and answers in their name."""

import asyncio
import signal
import time
from contextlib import closing
from pathlib import Path

import pytest

from tests.system.harness import PATIENCE_S, Robot, robot
from tests.system.ports import participants
from tests.system.rogue import answer, open_rogue
from tests.system.zenoh_wire import ROUTER, WireSession
from wire import topics
from wire.bus import NoReplyError
from wire.messages import Bool, SafetyStatus, TriggerResponse, encode

pytestmark = pytest.mark.timeout(120)

TOKENS = 1500


def say(text: str) -> None:
    print(f"\n    measured: {text}")


@pytest.mark.timed
async def test_a_killed_teleop_stops_the_robot_at_once_though_a_stranger_holds_its_token(
    tmp_path: Path,
) -> None:
    async with robot(tmp_path, teleop=False) as subject:
        stranger = open_rogue(participants(subject.endpoint))
        try:
            token = stranger.liveliness().declare_token(f"robot/{topics.alive(topics.TELEOP)}")
            subject.start_teleop()
            await subject.drive()
            killed_s = subject.kill(topics.TELEOP)
            to_zero_s = await subject.zero_after(killed_s)
            await subject.until(lambda: "SOURCE_LOST" in subject.status.reasons, "SOURCE_LOST")
            say(f"SIGKILL to zero on cmd_vel: {to_zero_s * 1e3:.1f} ms")
            assert to_zero_s < 0.1, "the command timeout stopped it, not the token"
            subject.start_teleop()  # which drives again, although the stranger still holds the token
            await subject.drive()
            token.undeclare()
        finally:
            stranger.close()


@pytest.mark.timed
async def test_the_supervisors_death_is_noticed_at_once_among_the_tokens_of_a_stranger(
    tmp_path: Path,
) -> None:
    async with robot(tmp_path, topics.SUPERVISOR, teleop=False) as subject:
        assert subject.bus is not None
        stranger = open_rogue(participants(subject.endpoint))
        try:
            tokens = [
                stranger.liveliness().declare_token(f"robot/{topics.alive(f'x{n}')}") for n in range(TOKENS)
            ]
            changes = subject.bus.watch_alive(nodes=[topics.SUPERVISOR])
            alive: list[bool] = []
            await subject.until(
                lambda: alive.extend(c.alive for c in changes.take() if not c.epoch) or alive == [True], "it"
            )
            killed_s = subject.signal(topics.SUPERVISOR, signal.SIGKILL)
            gone: list[float] = []
            await subject.until(
                lambda: gone.extend(c.arrival_s for c in changes.take() if not c.alive) or gone != [],
                "its end",
            )
            say(
                f"SIGKILL to the end of its token, beside {len(tokens)} others: {(gone[0] - killed_s) * 1e3:.1f} ms"
            )
            assert gone[0] - killed_s < 0.1
        finally:
            stranger.close()


@pytest.mark.smoke
async def test_a_strangers_answer_to_a_reset_is_not_believed(tmp_path: Path) -> None:
    async with robot(tmp_path, teleop=False) as subject:
        assert subject.bus is not None
        stranger = open_rogue(participants(subject.endpoint))
        lie = encode(TriggerResponse(success=True, message="the stranger says that all is well"))
        answers = [answer(stranger, "robot/**", lie), answer(stranger, "robot/supervisor/*", lie)]
        try:
            await _press(subject)
            for _ in range(5):
                reply = await subject.bus.call(topics.SUPERVISOR_RESET, timeout_s=PATIENCE_S)
                assert "stranger" not in reply.message
            subject.kill(topics.SUPERVISOR)
            with pytest.raises(NoReplyError):
                await subject.bus.call(topics.SUPERVISOR_RESET)
        finally:
            for one in answers:
                one.undeclare()
            stranger.close()


@pytest.mark.timed
async def test_a_stranger_cannot_pose_as_a_router_which_would_get_every_query(tmp_path: Path) -> None:
    """Zenoh passes a router each query without a declaration; a silent one delays each reset by a second."""
    async with robot(tmp_path, teleop=False) as subject:
        assert subject.bus is not None
        with closing(WireSession(subject.endpoint, ROUTER)) as router, pytest.raises(OSError, match="closed"):
            router.confirm()
        with closing(WireSession(subject.endpoint)) as client:
            client.confirm()
        asked_s = time.monotonic()
        await subject.bus.call(topics.SUPERVISOR_RESET)
        say(f"answer to a reset after a router was refused: {(time.monotonic() - asked_s) * 1e3:.1f} ms")


@pytest.mark.timed
async def test_copied_tokens_of_a_run_neither_hide_its_death_nor_lock_the_next_one_out(
    tmp_path: Path,
) -> None:
    """Tokens can be read by all, so any participant that may hold those of a source may copy them."""
    async with robot(tmp_path) as subject:
        stranger = open_rogue(participants(subject.endpoint))
        try:
            await subject.drive()
            alive = stranger.liveliness().get(f"robot/{topics.alive(topics.TELEOP)}/**")
            held = {str(reply.ok.key_expr) for reply in alive if reply.ok is not None}
            assert len(held) == 2, "the source's token, and that of its run"
            copies = [stranger.liveliness().declare_token(key) for key in held]
            list(stranger.get("@/*/peer", timeout=10.0))  # the hub has processed them
            to_zero_s = await subject.zero_after(subject.kill(topics.TELEOP))
            say(f"SIGKILL to zero beside {len(copies)} copied tokens: {to_zero_s * 1e3:.1f} ms")
            assert to_zero_s < 0.1, "the command timeout stopped it, not the end of the session"
            await subject.until(lambda: "SOURCE_LOST" in subject.status.reasons, "SOURCE_LOST")
            started_s = time.monotonic()
            subject.start_teleop()
            await subject.until(lambda: "SOURCE_LOST" not in subject.status.causes, "the next teleop")
            say(
                f"from the start of the next teleop to its first command: {time.monotonic() - started_s:.2f} s"
            )
            await subject.drive()
        finally:
            stranger.close()


async def _press(subject: Robot) -> None:
    assert subject.bus is not None
    estop = subject.bus.publisher(topics.ESTOP)
    deadline_s = time.monotonic() + 20
    while "ESTOP" not in subject.status.reasons:
        assert time.monotonic() < deadline_s
        estop.put(Bool(data=True))
        subject.look()
        await asyncio.sleep(0.05)
    assert subject.status.mode == SafetyStatus.STOPPED
