"""The demands of a fault, alone and with another fault."""

import pytest

from faults.classes import BY_NAME, CLASSES, classes_by_themselves, virtual_classes
from faults.demands import LEEWAY_S, SLOW_S, TOLERANCE_M, Done, asked_age_s, demands, tolerance_m
from faults.promises import Kind
from faults.simulated.scenario import EPISODE_S, draw


@pytest.mark.parametrize(
    ("name", "kind", "promise", "bound_s"),
    [
        ("teleop_sigkill", Kind.ZERO, 2, 0.010),
        ("teleop_blocked", Kind.ZERO, 3, 0.22),
        ("net_healed", Kind.ZERO, 3, 0.22),
        ("sim_scan_nan", Kind.ZERO, 5, 0.27),
        ("supervisor_sigkill", Kind.BRAKE, 4, 0.010),
        ("supervisor_blocked", Kind.BRAKE, 4, 0.17),
        ("net_base_deaf", Kind.BRAKE, 4, 0.17),
    ],
)
def test_a_fault_alone_is_held_to_its_bound(name: str, kind: Kind, promise: int, bound_s: float) -> None:
    (demand,) = demands([Done(name, 1.0, 3.0)], alone=True)
    assert (demand.kind, demand.promise, demand.until_s) == (kind, promise, 3.0)
    assert demand.from_s == pytest.approx(1.0 + bound_s + LEEWAY_S)


def test_one_that_ends_before_its_bound_demands_nothing() -> None:
    assert demands([Done("teleop_blocked", 1.0, 1.2)], alone=True) == []


def test_with_another_source_a_dead_teleop_demands_no_zero() -> None:
    assert demands([Done("teleop_sigkill", 1.0, 3.0)], alone=False) == []


def test_whoever_speaks_in_teleops_name_may_keep_the_robot_going() -> None:
    done = [Done("teleop_sigkill", 1.0, 6.0), Done("wire_flood", 1.5, 1.6)]
    assert demands(done, alone=True) == []


def test_two_at_once_have_more_time_and_the_first_end_counts() -> None:
    done = [Done("teleop_sigkill", 1.0, 6.0), Done("net_delayed", 1.5, 4.0)]
    (demand,) = demands(done, alone=True)
    assert demand.from_s == pytest.approx(1.0 + 0.010 + LEEWAY_S + SLOW_S)
    assert demand.until_s == 4.0


def test_a_fault_of_a_sensor_lasts_until_the_next_one_takes_its_place() -> None:
    """Found by seed 2067: without odometry, the sensor's scans were valid again."""
    blind, next_one = Done("sim_scan_nan", 1.0, 6.0), Done("sim_odom_gone", 4.0, 7.0)
    (demand,) = demands([blind, next_one], alone=True)
    assert (demand.promise, demand.until_s) == (5, 4.0)
    assert demands([blind, Done("sim_odom_gone", 1.0, 7.0)], alone=True) == []


def test_a_simulation_that_stands_brakes_nothing() -> None:
    done = [Done("supervisor_sigkill", 1.0, 6.0), Done("sim_sigstop", 1.5, 4.0)]
    assert [demand.kind for demand in demands(done, alone=True)] == [Kind.ZERO]


def test_a_delay_that_nobody_can_see_makes_wishes_older() -> None:
    plain_s = asked_age_s([Done("net_cut", 1.0, 2.0, {"delay_s": 9.0})])
    assert asked_age_s([Done("net_delayed", 1.0, 2.0, {"delay_s": 0.3})]) == pytest.approx(plain_s + 0.6)


def test_what_acts_late_comes_nearer() -> None:
    assert tolerance_m([Done("teleop_sigkill", 1.0, 2.0)]) == TOLERANCE_M
    hung_m = tolerance_m([Done("supervisor_blocked", 1.0, 2.0)])
    slow_m = tolerance_m([Done("net_delayed_base", 1.0, 2.0, {"delay_s": 0.1})])
    slower_m = tolerance_m([Done("net_delayed_base", 1.0, 2.0, {"delay_s": 0.4})])
    assert TOLERANCE_M < hung_m < slow_m < slower_m < 0.15


def test_every_class_is_in_the_table_once() -> None:
    assert len(BY_NAME) == len(CLASSES)


def test_a_seed_has_one_scenario_and_another_seed_another() -> None:
    assert draw(7) == draw(7)
    assert draw(7) != draw(8)
    scenarios = [draw(seed) for seed in range(400)]
    assert all(fault.at_s < EPISODE_S for scenario in scenarios for fault in scenario.faults)
    assert all(scenario.faults for scenario in scenarios)
    drawn = {fault.name for scenario in scenarios for fault in scenario.faults}
    virtual = {one.name for one in (*virtual_classes(), *classes_by_themselves())}
    assert drawn == virtual, "every class has its turn"


def test_seeds_that_end_in_7_try_each_class_with_trials_of_its_own_and_no_other_seed_does() -> None:
    own = {one.name for one in classes_by_themselves()}
    for seed in range(400):
        scenario = draw(seed)
        names = {fault.name for fault in scenario.faults}
        assert scenario.straight == (seed % 10 == 7)
        assert (len(names) == 1 and names <= own) if scenario.straight else names.isdisjoint(own)
    assert {draw(10 * number + 7).faults[0].name for number in range(len(own))} == own


@pytest.mark.parametrize(
    ("name", "kind", "promise", "window_s", "reasons"),
    [
        ("sim_scan_frozen_no_odom", Kind.STOPPED, 5, (1.0, 1.32 + LEEWAY_S), ("ODOM_STALE", "SCAN_INVALID")),
        (
            "sim_scan_frozen_odom_zero",
            Kind.STOPPED,
            5,
            (1.0, 2.0 + LEEWAY_S),
            ("BASE_UNRESPONSIVE", "SCAN_INVALID"),
        ),
        ("wire_second_lidar_steady", Kind.NAMED, 5, (1.0, 1.27 + LEEWAY_S), ("SENSOR_CONFLICT",)),
        ("wire_second_lidar_flood", Kind.NAMED, 5, (1.0, 1.27 + LEEWAY_S), ("SENSOR_CONFLICT",)),
        ("machine_suspend", Kind.NAMED, 7, (1.0, 1.02 + LEEWAY_S), ("OVERRUN",)),
        ("estop_sim_sigkill", Kind.ZERO, 7, (1.04 + LEEWAY_S, 4.0), ("ESTOP",)),
        ("sim_scan_stray", Kind.UNHINDERED, 8, (1.0, 4.0), ()),
    ],
)
def test_a_class_with_trials_of_its_own_asks_for_its_state_or_its_event(
    name: str, kind: Kind, promise: int, window_s: tuple[float, float], reasons: tuple[str, ...]
) -> None:
    (demand,) = demands([Done(name, 1.0, 4.0)], alone=True)
    assert (demand.kind, demand.promise, demand.reasons) == (kind, promise, reasons)
    assert (demand.from_s, demand.until_s) == pytest.approx(window_s)


@pytest.mark.parametrize("name", ["sim_scan_dirt", "sim_scan_dropout", "sim_scan_short"])
def test_dirt_dropouts_and_a_short_reach_are_held_to_the_distance_alone(name: str) -> None:
    assert demands([Done(name, 1.0, 4.0)], alone=True) == []


def test_the_parts_of_a_trial_draw_from_streams_of_their_own() -> None:
    scenario = draw(7)
    assert scenario.stream("network").random() == draw(7).stream("network").random()
    assert scenario.stream("network").random() != scenario.stream("operator").random()
