"""The campaign's observer on messages that reach it."""

import time
from collections.abc import AsyncGenerator
from pathlib import Path
from typing import Any, cast

import pytest

from faults.classes import BASE_TIMEOUT_S
from faults.real.rig.observer import Observer
from faults.real.rig.wheels import WheelPipe
from virtual.network import VirtualNetwork
from wire import topics
from wire.messages import encode, planar_twist
from wire.stamp import Stamp

SUPERVISOR, TELEOP = b"S" * 16, b"T" * 16
TELEOP_KEY = topics.source_cmd_vel(topics.TELEOP).key


class Stage:
    """An observer, and samples that other clients publish."""

    def __init__(self, path: Path) -> None:
        self.bus = VirtualNetwork().open_hub("observer")
        self.pipe = WheelPipe(path / "wheels")
        self.observer = Observer(cast("Any", self.bus), self.pipe)
        self.sequence = 0

    def put(self, key: str, gid: bytes | None, *, age_s: float = 0.0) -> None:
        self.sequence += 1
        stamp = (
            None if gid is None else Stamp(self.sequence, round((time.monotonic() - age_s) * 1e9), gid).pack()
        )
        self.bus.receive(key, encode(planar_twist(0.5, 0.0)), stamp)


@pytest.fixture
async def stage(tmp_path: Path) -> AsyncGenerator[Stage]:
    stage = Stage(tmp_path)
    yield stage
    stage.observer.close()
    stage.pipe.close()


async def test_what_comes_under_the_key_of_another_is_counted_and_not_judged(stage: Stage) -> None:
    for _ in range(5):
        stage.put(TELEOP_KEY, TELEOP)
        stage.put(topics.CMD_VEL.key, SUPERVISOR)
    stage.observer.look()
    stage.put(topics.CMD_VEL.key, TELEOP)
    stage.put(TELEOP_KEY, SUPERVISOR)
    stage.put(topics.CMD_VEL.key, SUPERVISOR)
    stage.put(topics.CMD_VEL.key, None)
    seen = stage.observer.look()
    assert (len(seen.commands), len(seen.asked), stage.observer.misdelivered) == (7, 5, 2)


async def test_who_was_first_heard_under_the_key_of_another_is_heard_all_the_same(stage: Stage) -> None:
    for key in (topics.CMD_VEL.key, *[TELEOP_KEY] * 5, topics.CMD_VEL.key):
        stage.put(key, TELEOP)
        stage.observer.look()
    seen = stage.observer.seen
    assert (len(seen.commands), len(seen.asked), stage.observer.misdelivered) == (1, 5, 1)


async def test_a_command_too_old_for_the_base_is_counted_and_not_judged(stage: Stage) -> None:
    stage.put(topics.CMD_VEL.key, SUPERVISOR, age_s=0.5 * BASE_TIMEOUT_S)
    stage.put(topics.CMD_VEL.key, SUPERVISOR, age_s=BASE_TIMEOUT_S + 0.01)
    assert (len(stage.observer.look().commands), stage.observer.late) == (1, 1)


async def test_a_wish_is_as_old_as_its_source_says(stage: Stage) -> None:
    stage.put(TELEOP_KEY, TELEOP, age_s=0.3)
    (asked,) = stage.observer.look().asked
    assert time.monotonic() - asked.sent_s == pytest.approx(0.3, abs=0.2)
    assert time.monotonic() - asked.sent_s >= 0.3
    stage.observer.trusts_stamps = False
    stage.put(TELEOP_KEY, TELEOP, age_s=0.3)
    assert stage.observer.look().asked[-1].sent_s > asked.sent_s + 0.29


async def test_a_source_whose_stamps_are_ahead_has_sent_its_wish_before_the_wish_arrived(
    stage: Stage,
) -> None:
    """A page's stamps are ahead by what delayed its first message; the base may move before this observer has its wish."""
    stage.put(TELEOP_KEY, TELEOP, age_s=-0.3)
    stage.observer.look()
    stage.put(TELEOP_KEY, TELEOP, age_s=-0.1)
    stage.put(TELEOP_KEY, SUPERVISOR, age_s=-0.1)
    first, late, other = stage.observer.look().asked
    assert late.sent_s - first.sent_s == pytest.approx(-0.2, abs=0.1)
    assert other.sent_s > late.sent_s + 0.1
