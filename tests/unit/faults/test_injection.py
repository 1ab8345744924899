"""One definition of each fault: its draw, what it does to a port, and the pairs of the real campaign."""

import math
from collections.abc import AsyncGenerator
from contextlib import aclosing
from random import Random
from types import SimpleNamespace
from typing import Any, cast

import pytest

from faults.classes import BY_NAME, CLASSES, PAIR, Group, classes_by_themselves, real_classes, virtual_classes
from faults.injection import DRAWS
from faults.port import Fault, Pillar
from faults.real.real_faults import NOT_IN_PAIRS, REAL_DRAWS, draw_pair
from faults.real.rig import stage as stages
from faults.real.rig.stage import Stage, StageError
from faults.simulated.fault_injection import VIRTUAL_DRAWS
from sim.sensor_faults import NO_FAULTS, parse_faults
from wire import topics
from wire.bus import NoReplyError


def drawn(name: str, seed: int = 0) -> Fault[Any]:
    return DRAWS[name](Random(seed))


class Recorder:
    """A port that records what is done to it; the named actions fail."""

    def __init__(self, *failing: str) -> None:
        self.done: list[tuple[object, ...]] = []
        self._failing = failing

    def __getattr__(self, action: str) -> Any:  # noqa: ANN401 - any action of a port
        def act(*arguments: object, **named: object) -> Any:  # noqa: ANN401 - as above
            self.done.append((action, *arguments, *named.items()))
            if action in self._failing:
                raise StageError(action)
            if action in {"pause", "restart", "sensors", "mend_sensors", "press_estop", "insist"}:
                return self._later()
            return 1.0

        return act

    async def _later(self) -> float:
        return 1.0


async def lived(fault: Fault[Any], port: Recorder) -> list[tuple[object, ...]]:
    """Return what a fault did until it had begun; the port has the rest."""
    steps: AsyncGenerator[float]
    async with aclosing(fault.steps(port)) as steps:
        assert await anext(steps) == 1.0
        begun, port.done = port.done, []
        assert [at_s async for at_s in steps] == []
    return begun


# --- the table


def test_every_class_has_one_draw_and_every_draw_a_class() -> None:
    assert not set(DRAWS) & {*REAL_DRAWS, *VIRTUAL_DRAWS}
    assert {*DRAWS, *REAL_DRAWS} >= {one.name for one in real_classes()} - {PAIR}
    assert {*DRAWS, *VIRTUAL_DRAWS} >= {one.name for one in (*virtual_classes(), *classes_by_themselves())}
    assert {*DRAWS, *REAL_DRAWS, *VIRTUAL_DRAWS, PAIR} == {one.name for one in CLASSES}


def test_a_class_that_one_campaign_alone_can_draw_is_in_the_other_ones_table_no_class() -> None:
    assert not any(BY_NAME[name].virtual for name in REAL_DRAWS)
    assert not any(BY_NAME[name].real for name in VIRTUAL_DRAWS)
    assert all(one.real or one.virtual for one in CLASSES)


@pytest.mark.parametrize("name", DRAWS)
async def test_every_fault_begins_and_ends_on_a_port_and_the_same_seed_does_the_same(name: str) -> None:
    done: list[object] = []
    for _ in range(2):
        port, fault = Recorder(), drawn(name, 5)
        begun = await lived(fault, port)
        assert begun
        assert port.done
        done.append((begun, port.done, fault.lasts_s))
    assert done[0] == done[1]


def test_a_pair_is_of_two_that_can_be_in_force_at_once() -> None:
    chance = Random(1)
    seen: set[str] = set()
    for _ in range(3000):
        first, second = draw_pair(chance)
        seen |= {first, second}
        assert first != second
        assert not {BY_NAME[first].group, BY_NAME[second].group} & NOT_IN_PAIRS
        assert not BY_NAME[first].by_itself
        assert not BY_NAME[second].by_itself
        for group in (Group.NETWORK, Group.WIRE):
            assert not BY_NAME[first].group is group is BY_NAME[second].group
    assert len(seen) > 30


# --- what is drawn


@pytest.mark.parametrize(
    ("name", "node", "up", "down"),
    [
        ("net_cut", topics.TELEOP, True, True),
        ("net_up_only", topics.TELEOP, False, True),
        ("net_down_only", topics.TELEOP, True, False),
        ("net_base_deaf", topics.SIM, False, True),
        ("net_base_mute", topics.SIM, True, False),
    ],
)
async def test_the_directions_that_a_class_names_are_cut(
    name: str, node: str, *, up: bool, down: bool
) -> None:
    port = Recorder()
    assert await lived(drawn(name), port) == [("cut", node, ("up", up), ("down", down))]
    assert port.done == [("heal", node)]


def test_what_a_plan_asks_the_sim_for_is_a_fault_that_it_has() -> None:
    names = [name for name in DRAWS if name.startswith("sim_scan") or name == "sim_odom_gone"]
    assert len(names) == 12
    for name in names:
        for seed in range(50):
            fault = drawn(name, seed)
            assert parse_faults(str(fault.parameters["faults"])) != NO_FAULTS
            assert (fault.pillar is not Pillar.BY_CHANCE) == BY_NAME[name].by_itself
            assert (fault.pillar is Pillar.NONE) == (name == "sim_scan_stray")


def test_dirt_is_1_to_20_degrees_wide_and_straight_ahead() -> None:
    widths_deg: list[float] = []
    for seed in range(300):
        (sector,) = parse_faults(str(drawn("sim_scan_dirt", seed).parameters["faults"])).blocked
        assert sector.start_rad == -sector.end_rad
        assert math.isnan(sector.code_m)
        widths_deg.append(math.degrees(2.0 * sector.end_rad))
    assert 0.9 < min(widths_deg) < 2.0
    assert 19.0 < max(widths_deg) < 20.1


def test_a_blocked_window_covers_straight_ahead_at_least_half_of_the_time() -> None:
    sectors = [
        parse_faults(str(drawn("sim_scan_blocked", seed).parameters["faults"])).blocked[0]
        for seed in range(300)
    ]
    assert sum(one.start_rad < 0.0 < one.end_rad for one in sectors) > 0.5 * len(sectors)
    widths_deg = [math.degrees(one.end_rad - one.start_rad) for one in sectors]
    assert 19.0 < min(widths_deg) < 30.0
    assert 110.0 < max(widths_deg) < 121.0


async def test_a_clock_that_steps_returns_and_steps_by_up_to_an_hour() -> None:
    steps_s: set[float] = set()
    for seed in range(100):
        port, fault = Recorder(), drawn("wire_clock_step", seed)
        node, by_s = fault.parameters["process"], fault.parameters["by_s"]
        assert await lived(fault, port) == [("step_clock", node, by_s)]
        assert port.done == [("step_clock", node, -float(by_s))]
        steps_s.add(abs(float(by_s)))
    assert (min(steps_s), max(steps_s)) == (0.05, 3600.0)


async def test_a_second_writer_whose_lidar_cannot_pause_is_ended() -> None:
    port = Recorder("sensors")
    with pytest.raises(StageError):
        await lived(drawn("wire_second_lidar_steady"), port)
    assert port.done[-2:] == [("end_attack", "second_lidar_steady"), ("mend_sensors",)]


# --- the real sim, which another fault may have ended


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
    await Stage.mend_sensors(cast("Any", stage))
    assert stage.asked == ["none"] * 4


async def test_a_sim_that_never_answers_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stages, "ALIVE_LIMIT_S", 0.05)
    with pytest.raises(StageError, match="no sim accepted"):
        await Stage.mend_sensors(cast("Any", StageOfASim(answers_from=math.inf)))


async def test_a_sim_that_does_not_answer_is_a_stage_that_did_not_do_it() -> None:
    async def call(*_: object, **__: object) -> None:
        raise NoReplyError(f"nobody answered {topics.SIM_FAULTS.key}")

    stage = SimpleNamespace(observer=SimpleNamespace(bus=SimpleNamespace(call=call)))
    with pytest.raises(StageError, match="does not take the faults 'all_nan'"):
        await Stage.sensors(cast("Any", stage), "all_nan")
