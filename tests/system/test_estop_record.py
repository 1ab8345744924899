"""A pressed e-stop survives every process: nothing moves until a reset, whichever process died."""

from pathlib import Path

import pytest

from tests.system.harness import Robot, is_zero, robot
from wire import topics
from wire.messages import Bool, SafetyStatus, header

pytestmark = pytest.mark.timeout(180)

ESTOP = "ESTOP"
TRY_S = 0.5
"""Time for which the operator requests motion."""


async def press(subject: Robot) -> None:
    """Press the e-stop, and wait for a status that shows it as recorded."""
    assert subject.bus is not None
    subject.bus.publisher(topics.ESTOP).put(Bool(data=True))
    await subject.until(
        lambda: ESTOP in subject.status.reasons and not subject.status.estop_record_problem,
        "a recorded e-stop",
    )


async def restart_supervisor(subject: Robot) -> None:
    """Kill and restart it, and wait for a status of the new process that has received the operator's commands."""
    subject.kill(topics.SUPERVISOR)
    subject.look()
    subject.status = SafetyStatus(header(""))
    subject.start(topics.SUPERVISOR)
    await subject.until(lambda: any(s.accepted for s in subject.status.sources), "a new supervisor")


async def nothing_moves(subject: Robot) -> None:
    """Send neutral, then motion: the commands are received, and ESTOP remains."""
    subject.type("s")
    await subject.until(lambda: _heard(subject.status, neutral=True), "a neutral teleop")
    subject.outputs.clear()
    await subject.press("www", lambda: _heard(subject.status, neutral=False), "a teleop that asks for motion")
    await subject.never(lambda: ESTOP not in subject.status.reasons, "released without a reset", TRY_S)
    assert subject.outputs
    assert all(is_zero(twist) for _, twist in subject.outputs)
    subject.type("s")


def _heard(status: SafetyStatus, *, neutral: bool) -> bool:
    return any(
        s.name == topics.TELEOP and s.accepted > 0 and s.age_s < 0.2 and s.neutral is neutral
        for s in status.sources
    )


async def test_a_killed_supervisor_comes_back_with_the_estop_latched_until_the_operator_resets_it(
    tmp_path: Path,
) -> None:
    async with robot(tmp_path) as subject:
        await subject.drive()
        await press(subject)
        await restart_supervisor(subject)
        assert ESTOP in subject.status.reasons
        await nothing_moves(subject)
        await subject.press("r", lambda: ESTOP not in subject.status.reasons, "a reset")
        await subject.until(lambda: not subject.status.estop_record_problem, "a recorded reset")
        await restart_supervisor(subject)
        await subject.drive()


@pytest.mark.parametrize("victim", [topics.TELEOP, topics.SIM])
async def test_the_estop_stays_latched_when_another_process_is_killed(tmp_path: Path, victim: str) -> None:
    async with robot(tmp_path) as subject:
        await subject.drive()
        await press(subject)
        subject.kill(victim)
        if victim == topics.TELEOP:
            subject.start_teleop()
        else:
            subject.start(victim)
        await nothing_moves(subject)


async def test_a_supervisor_that_cannot_read_the_record_starts_latched_and_says_what_is_wrong(
    tmp_path: Path,
) -> None:
    (tmp_path / "estop-robot.latched").mkdir()
    async with robot(tmp_path) as subject:
        await subject.until(lambda: ESTOP in subject.status.reasons, "a latched e-stop")
        await nothing_moves(subject)
        await subject.until(lambda: _heard(subject.status, neutral=True), "a neutral teleop")
        reply = await subject.answer_to_reset()
        assert reply.success
        assert "the next supervisor starts latched" in reply.message
        await subject.until(lambda: subject.status.estop_record_problem != "", "the problem in the status")
