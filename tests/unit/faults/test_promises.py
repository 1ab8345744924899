"""Each promise at its boundary."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from faults.promises import Bounds, Demand, Kind, violations
from faults.seen import Asked, Command, Motion, Seen, Status
from faults.trial import BrokenPromise

FREE: tuple[str, ...] = ()


def commands(*samples: tuple[float, float]) -> list[Command]:
    return [Command(time_s, linear_m_s, 0.0) for time_s, linear_m_s in samples]


def numbers(found: list[BrokenPromise]) -> list[int]:
    return [violation.promise for violation in found]


def driving(linear_m_s: float, deceleration_m_s2: float = 0.0) -> list[Motion]:
    """Two seconds, 50 samples each."""
    return [
        Motion(time_s, 0.0, 0.0, max(0.0, linear_m_s - deceleration_m_s2 * time_s), 0.0)
        for time_s in (0.02 * number for number in range(100))
    ]


# --- 1


@pytest.mark.parametrize("command", [(1.0, 2.0), (-1.0, -2.0), (0.0, 0.0)])
def test_a_command_at_the_limits_is_kept(command: tuple[float, float]) -> None:
    assert violations(Seen(commands=[Command(0.0, *command)])) == []


@pytest.mark.parametrize("value", [1.00001, -1.00001, math.nan, math.inf])
def test_a_command_beyond_the_limits_or_no_number_is_reported_once(value: float) -> None:
    seen = Seen(commands=[Command(0.0, value, 0.0), Command(0.1, 0.0, value * 2)])
    (found,) = violations(seen)
    assert (found.promise, found.time_s) == (1, 0.0)


def test_motion_strictly_between_a_stop_and_the_next_status_is_broken() -> None:
    statuses = [Status(1.0, ("OBSTACLE",)), Status(1.1, FREE)]
    assert numbers(violations(Seen(commands=commands((1.05, 0.1)), statuses=statuses))) == [1]
    assert violations(Seen(commands=commands((1.0, 0.1), (1.1, 0.1)), statuses=statuses)) == []
    assert violations(Seen(commands=commands((1.05, 0.0)), statuses=statuses)) == []


def test_the_leeway_lets_a_command_and_its_status_cross() -> None:
    seen = Seen(commands=commands((1.05, 0.1)), statuses=[Status(1.0, ("OBSTACLE",)), Status(1.2, FREE)])
    assert numbers(violations(seen, bounds=Bounds(status_leeway_s=0.04))) == [1]
    assert violations(seen, bounds=Bounds(status_leeway_s=0.06)) == []


# --- 2, 3, 5


@pytest.mark.parametrize("promise", [2, 3, 5])
def test_zero_is_demanded_within_the_window_only(promise: int) -> None:
    demand = Demand(Kind.ZERO, promise, "a fault", 1.0, 2.0)
    assert numbers(violations(Seen(commands=commands((1.5, 0.2), (1.6, 0.2))), [demand])) == [promise]
    kept = Seen(commands=commands((0.9, 0.2), (1.0, 0.2), (1.5, 0.0), (2.0, 0.2)))
    assert violations(kept, [demand]) == []


def test_a_motion_needs_a_wish_that_is_young_enough() -> None:
    asked = [Asked(1.0, "teleop", 0.5, 0.0), Asked(1.1, "teleop", 0.0, 0.0)]
    bounds = Bounds(asked_age_s=0.25)
    assert violations(Seen(commands=commands((1.25, 0.5)), asked=asked), bounds=bounds) == []
    late = Seen(commands=commands((1.26, 0.5), (1.28, 0.5), (1.3, 0.0), (1.4, 0.5)), asked=asked)
    assert numbers(violations(late, bounds=bounds)) == [3, 3], "once for each time that it happens"
    assert numbers(violations(Seen(commands=commands((0.5, 0.5)), asked=asked), bounds=bounds)) == [3]


def test_the_wheels_set_off_by_a_wish_that_is_young_enough() -> None:
    asked = [Asked(1.0, "teleop", 0.5, 0.0), Asked(1.1, "teleop", 0.0, 0.0)]
    bounds = Bounds(asked_age_s=0.25)

    def found(*driven: tuple[float, bool]) -> list[int]:
        return numbers(violations(Seen(asked=asked, driven=list(driven)), bounds=bounds))

    assert found((0.9, False), (1.25, True), (1.9, False)) == []
    assert found((0.9, False), (1.26, True), (1.27, False), (1.3, True)) == [3, 3]
    assert found((1.9, True), (2.0, False)) == [], "it was set off before"
    assert found((0.5, False), (0.9, True)) == [3], "nobody has asked yet"


# --- 4


def test_a_base_that_brakes_as_it_is_trusted_to_is_kept() -> None:
    demand = Demand(Kind.BRAKE, 4, "the supervisor is gone", 0.0, 2.0)
    assert violations(Seen(motions=driving(0.8, 1.5)), [demand]) == []
    assert violations(Seen(motions=driving(0.0)), [demand]) == []
    assert violations(Seen(), [demand]) == []


@pytest.mark.parametrize("deceleration_m_s2", [0.0, 0.5, 1.2])
def test_a_base_that_brakes_less_is_broken(deceleration_m_s2: float) -> None:
    demand = Demand(Kind.BRAKE, 4, "the supervisor is gone", 0.0, 2.0)
    assert numbers(violations(Seen(motions=driving(0.8, deceleration_m_s2)), [demand])) == [4]


def test_a_base_that_still_turns_is_broken() -> None:
    turning = [Motion(0.02 * number, 0.0, 0.0, 0.0, 1.0) for number in range(100)]
    demand = Demand(Kind.BRAKE, 4, "the supervisor is gone", 0.0, 2.0)
    assert numbers(violations(Seen(motions=turning), [demand])) == [4]


# --- 6


def approach(steps: list[tuple[float, float]], speed_m_s: float = 0.0) -> list[Motion]:
    """From 0.5 m on: (own approach, the object's approach) of each sample."""
    clearance_m, motions = 0.5, [Motion(0.0, 0.0, 0.0, speed_m_s, 0.0, 0.5)]
    for number, (own_m, by_itself_m) in enumerate(steps, 1):
        clearance_m -= own_m + by_itself_m
        touching = clearance_m <= 0.0
        motions.append(Motion(0.02 * number, 0.0, 0.0, speed_m_s, 0.0, clearance_m, own_m, touching))
    return motions


def test_the_robot_may_come_to_the_stop_distance_by_itself() -> None:
    assert violations(Seen(motions=approach([(0.02, 0.0)] * 10))) == []


def test_and_a_centimetre_of_it_further_but_no_more() -> None:
    assert violations(Seen(motions=approach([(0.005, 0.0)] * 41))) == []
    (found,) = violations(Seen(motions=approach([(0.005, 0.0)] * 60)))
    assert found.promise == 6
    assert 0.0 < found.time_s < 1.0, "at once"


def test_it_may_come_again_after_it_was_away() -> None:
    there_and_back = [(0.02, 0.0)] * 11 + [(-0.02, 0.0)] * 11
    (first, second) = violations(Seen(motions=approach(there_and_back * 2)))
    assert (first.promise, second.promise) == (6, 6)


def test_what_comes_by_itself_may_even_touch() -> None:
    assert violations(Seen(motions=approach([(0.0, 0.02)] * 30))) == []


def test_from_a_surprise_it_may_use_its_braking_distance() -> None:
    """An object is placed 0.2 m ahead of a robot at 0.3 m/s: 0.09 m to react, 0.03 m to brake."""
    surprise = [(0.0, 0.3)] + [(0.006, 0.0)] * 20
    assert violations(Seen(motions=approach(surprise, 0.3))) == []
    assert numbers(violations(Seen(motions=approach([(0.0, 0.3)] + [(0.006, 0.0)] * 30, 0.3)))) == [6]
    slow = approach([(0.0, 0.3)] + [(0.006, 0.0)] * 30, 0.0)
    assert numbers(violations(Seen(motions=slow))) == [6], "one that stands has nothing to brake"


def test_what_is_put_where_the_robot_cannot_stop_in_time_is_a_surprise_and_what_is_put_beyond_is_none() -> (
    None
):
    """At 1 m/s it needs 0.3 m to react and 1/3 m to brake, before the stop distance."""
    fast = approach([(0.02, 0.0)] * 12, 1.0)

    def put(away_m: float) -> Seen:
        return Seen(motions=[fast[0]._replace(time_s=-0.02), fast[0]._replace(appeared_m=away_m), *fast[1:]])

    needed_m = 0.3 + 0.3 + 1.0 / 3.0
    assert violations(put(math.nextafter(needed_m, 0.0))) == []
    assert numbers(violations(put(math.nextafter(needed_m, 1.0)))) == [6]


def test_what_is_put_nearer_still_is_another_surprise_and_what_walks_up_is_not() -> None:
    put = [(0.0, 0.21), *[(0.006, 0.0)] * 20, (0.0, 0.06), *[(0.006, 0.0)] * 20]
    assert violations(Seen(motions=approach(put, 0.3))) == []
    walked = [(0.0, 0.21)] + [(0.006, 0.002)] * 30
    assert numbers(violations(Seen(motions=approach(walked, 0.3)))) == [6]


def test_what_passes_by_may_turn_a_way_out_into_a_way_in_for_a_braking_distance() -> None:
    """Found by the campaign (seed 6330): at 0.3 m/s it needs 0.09 m to react and 0.03 m to brake."""
    passed = [(0.0, 0.21)] + [(-0.005, 0.01)] * 80
    assert violations(Seen(motions=approach([*passed, *[(0.006, -0.006)] * 20], 0.3))) == []
    assert numbers(violations(Seen(motions=approach([*passed, *[(0.006, -0.006)] * 30], 0.3)))) == [6]
    gone = [(0.0, 0.22)] + [(-0.005, 0.005)] * 80 + [(0.0, 0.0)] * 80
    assert numbers(violations(Seen(motions=approach([*gone, *[(0.006, -0.006)] * 20], 0.3)))) == [6]


def test_an_old_surprise_excuses_nothing() -> None:
    late = approach([(0.0, 0.25)] + [(0.0, 0.0)] * 100 + [(0.006, 0.0)] * 20, 0.3)
    assert numbers(violations(Seen(motions=late))) == [6]


def test_a_touch_by_its_own_motion_is_reported_as_one() -> None:
    (found,) = violations(Seen(motions=approach([(0.6, 0.0)])))
    assert "touching" in found.sentence


# --- 7


def after(reasons: tuple[str, ...], asked: list[Asked], owner: str = "teleop") -> list[int]:
    statuses = [Status(0.5, FREE, owner), Status(1.0, reasons, owner), Status(2.0, FREE, owner)]
    return numbers(violations(Seen(commands=commands((2.1, 0.3)), statuses=statuses, asked=asked)))


def test_motion_after_a_stop_needs_a_neutral_of_that_source_since_it_began() -> None:
    assert after(("COMMAND_TIMEOUT",), []) == [7]
    assert after(("COMMAND_TIMEOUT",), [Asked(0.99, "teleop", 0.0, 0.0)]) == [7]
    assert after(("COMMAND_TIMEOUT",), [Asked(1.5, "joy", 0.0, 0.0)]) == [7]
    assert after(("COMMAND_TIMEOUT",), [Asked(1.5, "teleop", 0.1, 0.0)]) == [7]
    assert after(("COMMAND_TIMEOUT",), [Asked(1.5, "teleop", 0.0, 0.0)]) == []


def test_a_stop_by_the_barrier_alone_may_be_left_without() -> None:
    assert after(("OBSTACLE",), []) == []
    assert after(("SCAN_BLIND", "OBSTACLE"), []) == []
    assert after(("SCAN_STALE", "OBSTACLE"), []) == [7]


def test_a_new_reason_asks_for_a_new_neutral() -> None:
    statuses = [
        Status(1.0, ("COMMAND_TIMEOUT",), "teleop"),
        Status(2.0, ("ESTOP", "COMMAND_TIMEOUT"), "teleop"),
        Status(3.0, FREE, "teleop"),
    ]
    asked = [Asked(1.5, "teleop", 0.0, 0.0)]
    moving = commands((3.1, 0.3))
    assert numbers(violations(Seen(commands=moving, statuses=statuses, asked=asked))) == [7]
    asked.append(Asked(2.5, "teleop", 0.0, 0.0))
    assert violations(Seen(commands=moving, statuses=statuses, asked=asked)) == []


def test_reasons_that_another_source_shows_are_its_own() -> None:
    statuses = [
        Status(0.5, FREE, "joy"),
        Status(1.0, ("OBSTACLE",), "joy"),
        Status(1.1, ("NO_COMMAND",), "teleop"),
        Status(1.2, FREE, "joy"),
    ]
    assert violations(Seen(commands=commands((1.3, 0.3)), statuses=statuses)) == []


def test_when_the_owner_is_lost_another_one_has_to_be_neutral_too() -> None:
    statuses = [
        Status(0.5, FREE, "teleop"),
        Status(1.0, ("SOURCE_LOST",), "teleop"),
        Status(1.2, FREE, "joy"),
    ]
    assert numbers(violations(Seen(commands=commands((1.3, 0.3)), statuses=statuses))) == [7]


def test_a_robot_that_does_not_move_needs_no_neutral() -> None:
    statuses = [Status(0.5, FREE, "teleop"), Status(1.0, ("ESTOP",), "teleop"), Status(2.0, FREE, "teleop")]
    assert violations(Seen(commands=commands((2.1, 0.0)), statuses=statuses)) == []


# --- 8


def test_drivable_means_that_once_no_stop_holds() -> None:
    demand = Demand(Kind.DRIVABLE, 8, "everything is mended", 1.0, 2.0)
    assert violations(Seen(statuses=[Status(1.5, ("ESTOP",)), Status(2.0, FREE)]), [demand]) == []
    (stopped,) = violations(Seen(statuses=[Status(0.9, FREE), Status(1.5, ("ESTOP",))]), [demand])
    assert (stopped.promise, "ESTOP" in stopped.sentence) == (8, True)
    (silent,) = violations(Seen(), [demand])
    assert "no status arrived" in silent.sentence


# --- all


finite = st.floats(-3.0, 3.0)


@given(st.lists(st.tuples(st.floats(0.0, 5.0), finite, finite), max_size=20))
def test_violations_come_in_order_of_time_and_never_fail(samples: list[tuple[float, float, float]]) -> None:
    seen = Seen(
        commands=[Command(*sample) for sample in sorted(samples)],
        motions=[Motion(time_s, x_m, 0.0, x_m, y_m, abs(y_m), x_m) for time_s, x_m, y_m in sorted(samples)],
    )
    demands = [Demand(kind, 3, "anything", 1.0, 4.0) for kind in Kind]
    found = violations(seen, demands)
    assert [v.time_s for v in found] == sorted(v.time_s for v in found)
    assert any(v.promise == 1 for v in found) == any(abs(v) > 1 or abs(w) > 2 for _, v, w in samples)


# --- required and forbidden consequences of sensor faults


def demand(kind: Kind, *reasons: str) -> Demand:
    return Demand(kind, 5, "a fault", 1.0, 2.0, reasons)


@pytest.mark.parametrize(("stopped_s", "broken"), [(0.5, []), (1.0, []), (2.0, []), (2.01, [5])])
def test_a_stop_counts_if_it_holds_in_the_window_or_begins_at_its_very_end(
    stopped_s: float, broken: list[int]
) -> None:
    statuses = [Status(0.0, FREE), Status(stopped_s, ("SCAN_INVALID",)), Status(3.0, FREE)]
    assert numbers(violations(Seen(statuses=statuses), [demand(Kind.STOPPED)])) == broken


def test_a_stop_that_was_over_before_the_window_does_not_count() -> None:
    statuses = [Status(0.0, ("OBSTACLE",)), Status(0.9, FREE), Status(1.5, FREE)]
    (found,) = violations(Seen(statuses=statuses), [demand(Kind.STOPPED)])
    assert found.sentence == "nothing stops the robot within 1000 ms: a fault"


def test_one_of_the_reasons_has_to_be_named_in_the_window() -> None:
    wanted = demand(Kind.NAMED, "SENSOR_CONFLICT", "OVERRUN")
    named = [Status(1.5, ("OBSTACLE", "OVERRUN"))]
    assert violations(Seen(statuses=named), [wanted]) == []
    others = [Status(1.5, ("OBSTACLE",)), Status(2.01, ("OVERRUN",))]
    (found,) = violations(Seen(statuses=others), [wanted])
    assert found.sentence == "OBSTACLE instead of SENSOR_CONFLICT or OVERRUN: a fault"
    (found,) = violations(Seen(), [wanted])
    assert found.sentence.startswith("no reason instead of")


def hindered(until_s: float, clearance_m: float, reason: str = "OBSTACLE") -> list[BrokenPromise]:
    """Stopped from 1.2 s to this time, with statuses every 20 ms, at this clearance."""
    times_s = [0.02 * number for number in range(120)]
    statuses = [Status(t, (reason,) if 1.2 <= t <= until_s + 1e-9 else FREE) for t in times_s]
    motions = [Motion(t, 0.0, 0.0, 0.0, 0.0, clearance_m) for t in times_s]
    return violations(Seen(statuses=statuses, motions=motions), [demand(Kind.UNHINDERED)])


def test_a_stop_for_an_obstacle_may_last_a_moment_where_there_is_none_and_no_longer() -> None:
    assert hindered(1.32, 0.5) == []
    (found,) = hindered(1.34, 0.5)
    assert found.sentence == "stopped for an obstacle with 0.50 m free all around: a fault"


def test_what_is_near_or_stops_for_another_reason_is_no_hindrance() -> None:
    assert hindered(2.0, 0.45) == []
    assert hindered(2.0, 0.5, "SCAN_BLIND") == []


def test_two_stops_of_a_moment_are_no_long_one() -> None:
    statuses = [
        Status(1.1, ("OBSTACLE",)),
        Status(1.2, FREE),
        Status(1.21, ("OBSTACLE",)),
        Status(1.33, ("OBSTACLE",)),
    ]
    motions = [Motion(0.02 * n, 0.0, 0.0, 0.0, 0.0, 0.5) for n in range(120)]
    assert violations(Seen(statuses=statuses, motions=motions), [demand(Kind.UNHINDERED)]) == []
