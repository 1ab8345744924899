"""Faults of the sim's sensors, with another fault that may have ended the sim."""

import math
from random import Random
from types import SimpleNamespace
from typing import Any, cast

import pytest

from faults.real.injectors import sensors
from faults.real.injectors.injection import Pillar
from faults.real.rig.stage import Stage, StageError
from sim.sensor_faults import NO_FAULTS, parse_faults
from wire import topics
from wire.bus import NoReplyError


class StageOfASim:
    """A sim that answers from the nth request on."""

    def __init__(self, answers_from: float) -> None:
        self.answers_from = answers_from
        self.asked: list[str] = []
        self.observer = SimpleNamespace(watch=self._watch)

    async def _watch(self, _duration_s: float) -> None: ...

    async def sensors(self, faults: str) -> float:
        self.asked.append(faults)
        if len(self.asked) < self.answers_from:
            raise StageError("nobody answers")
        return 0.0


async def test_the_sensors_are_made_well_as_soon_as_there_is_a_sim_to_be_told_so() -> None:
    stage = StageOfASim(answers_from=4)
    await sensors.PLANS["sim_scan_nan"](Random(0)).lift(cast("Any", stage))
    assert stage.asked == ["none"] * 4


async def test_a_sim_that_never_answers_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sensors, "ALIVE_LIMIT_S", 0.05)
    with pytest.raises(StageError, match="no sim accepted"):
        await sensors.PLANS["sim_scan_nan"](Random(0)).lift(
            cast("Any", StageOfASim(answers_from=float("inf")))
        )


async def test_a_sim_that_does_not_answer_is_a_stage_that_did_not_do_it() -> None:
    async def call(*_: object, **__: object) -> None:
        raise NoReplyError(f"nobody answered {topics.SIM_FAULTS.key}")

    stage = SimpleNamespace(observer=SimpleNamespace(bus=SimpleNamespace(call=call)))
    with pytest.raises(StageError, match="does not take the faults 'all_nan'"):
        await Stage.sensors(cast("Any", stage), "all_nan")


REAL_SENSORS = [
    "sim_scan_dirt",
    "sim_scan_dropout",
    "sim_scan_short",
    "sim_scan_stray",
    "sim_scan_frozen_no_odom",
    "sim_scan_frozen_odom_zero",
]


@pytest.mark.parametrize("name", REAL_SENSORS)
def test_what_a_plan_asks_the_sim_for_is_a_fault_that_it_has(name: str) -> None:
    for seed in range(50):
        injection = sensors.PLANS[name](Random(seed))
        assert parse_faults(str(injection.parameters["faults"])) != NO_FAULTS
        assert (injection.pillar is Pillar.NONE) == (name == "sim_scan_stray")


def test_dirt_is_1_to_20_degrees_wide_and_straight_ahead() -> None:
    widths_deg: list[float] = []
    for seed in range(300):
        text = str(sensors.PLANS["sim_scan_dirt"](Random(seed)).parameters["faults"])
        (sector,) = parse_faults(text).blocked
        assert sector.start_rad == -sector.end_rad
        assert math.isnan(sector.code_m)
        widths_deg.append(math.degrees(2.0 * sector.end_rad))
    assert 0.9 < min(widths_deg) < 2.0
    assert 19.0 < max(widths_deg) < 20.1
