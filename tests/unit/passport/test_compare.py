"""Which limits became worse."""

from passport.compare import SAME, changes
from tests.unit.passport.records import cell, record, run

KILLED = "operator's program killed"


def test_a_longer_distance_is_worse_and_a_shorter_one_is_not() -> None:
    found = changes(record(cell(KILLED, run(0.3))), record(cell(KILLED, run(0.4))))
    assert [(one.quantity, one.is_worse) for one in found] == [
        ("distance", True),
        ("stopping time", False),
        ("reaction", False),
    ]
    assert not any(
        one.is_worse for one in changes(record(cell(KILLED, run(0.4))), record(cell(KILLED, run(0.3))))
    )


def test_a_turn_has_an_angle_in_rad() -> None:
    found = changes(
        record(cell("turn", run(0.3), speed_m_s=2.0, turn=True)),
        record(cell("turn", run(0.4), speed_m_s=2.0, turn=True)),
    )
    assert [(one.quantity, one.unit, one.is_worse) for one in found] == [
        ("angle", "rad", True),
        ("stopping time", "s", False),
        ("reaction", "s", False),
    ]


def test_a_difference_below_half_a_millimetre_is_none() -> None:
    (distance, *_) = changes(record(cell(KILLED, run(0.3))), record(cell(KILLED, run(0.3 + 0.9 * SAME))))
    assert not distance.is_worse
    (distance, *_) = changes(record(cell(KILLED, run(0.3))), record(cell(KILLED, run(0.3 + 1.1 * SAME))))
    assert distance.is_worse


def test_a_limit_that_is_no_longer_known_is_worse() -> None:
    lost = changes(record(cell(KILLED, run())), record())
    assert [one.is_worse for one in lost] == [True, True, True]
    failed = changes(record(cell(KILLED, run())), record(cell(KILLED, run(stopped=False))))
    assert [(one.new, one.is_worse) for one in failed] == [(None, True)] * 3


def test_a_new_cell_is_not_worse() -> None:
    found = changes(record(), record(cell(KILLED, run())))
    assert [(one.old, one.is_worse) for one in found] == [(None, False)] * 3
    assert found[0].result["worse"] is False
    assert found[0].result["fault"] == KILLED


def test_a_robot_that_does_not_stop_is_worse_also_in_a_new_cell() -> None:
    old = record(cell(KILLED, run()))
    new = record(cell(KILLED, run()), cell("e-stop", run(stopped=False)))
    assert [(one.cell.fault, one.is_worse) for one in changes(old, new) if one.is_different] == [
        ("e-stop", True)
    ] * 3
    assert not any(one.is_in_both for one in changes(old, new) if one.is_different)


def test_a_robot_that_stops_again_is_comparable_and_not_worse() -> None:
    found = changes(record(cell(KILLED, run(stopped=False))), record(cell(KILLED, run())))
    assert [(one.is_in_both, one.is_different, one.is_worse) for one in found] == [(True, True, False)] * 3


def test_a_robot_that_stopped_in_neither_has_nothing_to_compare() -> None:
    failed = record(cell(KILLED, run(stopped=False)))
    assert changes(failed, failed) == []


def test_other_speeds_and_loads_are_other_cells() -> None:
    found = changes(record(cell(KILLED, run())), record(cell(KILLED, run(), load_percent=100)))
    assert len(found) == 6


def test_a_cell_without_runs_and_a_quantity_that_neither_shows_are_left_out() -> None:
    assert changes(record(cell(KILLED)), record(cell(KILLED))) == []
    cut = record(cell("supervisor killed", run(stop_s=None)))
    assert [one.quantity for one in changes(cut, cut)] == ["distance"]


def test_a_turn_is_not_compared_with_a_straight_stop() -> None:
    found = changes(record(cell(KILLED, run())), record(cell(KILLED, run(), turn=True)))
    assert not any(one.is_in_both for one in found)
