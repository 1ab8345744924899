"""A link that was slow from the start: the age of a command does not contain its delay, and teleop measures it."""

import asyncio
import sys
from pathlib import Path

import pytest

from faults.real.rig.helper_process import Links
from teleop.service import RESET_TIMEOUT_S
from tests.system.harness import is_zero, robot
from tests.system.operators import Operator, until
from wire import topics
from wire.messages import SafetyStatus

EACH_WAY_S = 0.3
"""Two of them exceed the limit of 0.5 s."""
CONFIG = Path(__file__).parents[2] / "deploy" / "robot.toml"
LEASE = "# lease_s = 0.4 "
pytestmark = pytest.mark.timed  # a busy machine adds its own delays to those of the link


async def test_no_motion_is_requested_over_a_slow_link_until_it_is_fast(tmp_path: Path) -> None:
    config, text = tmp_path / "robot.toml", CONFIG.read_text()
    assert LEASE in text
    # With the lease of TCP, 0.4 s, no session opens over such a link; with that of QUIC, one does.
    config.write_text(text.replace(LEASE, "lease_s = 2.0 "))
    async with robot(tmp_path, teleop=False, config=config) as subject:
        links = Links(subject.endpoint, (topics.TELEOP,), environment={})
        links.delay(topics.TELEOP, EACH_WAY_S, EACH_WAY_S)
        operator = Operator(
            *(sys.executable, "-m", "teleop", "--config", str(config)),
            *("--endpoint", links.endpoints[topics.TELEOP]),
        )
        try:
            await until(lambda: "the robot answers after 0.6" in operator.picture)
            assert operator.picture.lstrip().startswith("LATE")
            await subject.until(lambda: subject.status.mode == SafetyStatus.READY, "READY")
            operator.type(b"www")
            await until(lambda: "setpoint is zero" in operator.picture)
            await subject.never(
                lambda: subject.status.mode == SafetyStatus.DRIVING, "it drove", 2 * EACH_WAY_S
            )
            assert all(is_zero(twist) for _, twist in subject.outputs)

            links.heal(topics.TELEOP)
            await until(lambda: "answers in 0.0" in operator.picture)
            subject.terminal = operator
            await subject.drive()
        finally:
            subject.terminal = None
            operator.close()
            links.close()


@pytest.mark.parametrize(("each_way_s", "gap_s"), [(0.0, 0.0), (0.1, 0.1)])
async def test_an_emergency_stop_after_a_reset_is_the_last_word(
    tmp_path: Path, each_way_s: float, gap_s: float
) -> None:
    """A reset first looks for the supervisor's session, which takes a round trip."""
    async with robot(tmp_path, teleop=False) as subject:
        links = Links(subject.endpoint, (topics.TELEOP,), environment={})
        links.delay(topics.TELEOP, each_way_s, each_way_s)
        operator = Operator(sys.executable, "-m", "teleop", "--endpoint", links.endpoints[topics.TELEOP])
        try:
            await subject.ready()
            subject.terminal = operator
            for _ in range(4):
                operator.type(b" ")
                await subject.until(lambda: "ESTOP" in subject.status.reasons, "ESTOP")
                await until(lambda: "STOPPED" in operator.picture)
                operator.type(b"r" if gap_s else b"r ")
                if gap_s:
                    await asyncio.sleep(gap_s)  # the fault itself: between the reset's two ways
                    operator.type(b" ")
                await subject.never(lambda: not operator.picture, "read its output", RESET_TIMEOUT_S + 0.5)
                assert "ESTOP" in subject.status.reasons
                # Pressed again if a busy machine has made it void, or has stopped the supervisor meanwhile.
                await subject.press("r", lambda: subject.status.mode == SafetyStatus.READY, "a reset")
        finally:
            subject.terminal = None
            operator.close()
            links.close()
