"""Every class of real faults has a plan, and pairs are compatible."""

from random import Random

from faults.classes import BY_NAME, CLASSES, Group
from faults.real.injectors.plans import NOT_IN_PAIRS, PAIR, PLANS, draw_pair, real_classes


def test_there_is_a_plan_for_every_real_class_and_for_no_other() -> None:
    assert set(PLANS) | {PAIR} == {one.name for one in real_classes()}


def test_what_is_neither_real_nor_virtual_is_no_class() -> None:
    assert all(one.real or one.virtual for one in CLASSES)


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
