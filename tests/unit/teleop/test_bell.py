"""When the bell rings."""

import math

from teleop.bell import CLOSER_M, PAUSE_S, WarningBell


def rings(*statuses: tuple[float, bool, float]) -> list[float]:
    bell = WarningBell()
    return [
        at
        for at, warning, nearest_m in statuses
        if bell.rings(warning=warning, nearest_m=nearest_m, now_s=at)
    ]


def test_it_rings_once_at_the_edge() -> None:
    assert rings((0.0, False, 0.6), (0.1, True, 0.49), (0.2, True, 0.49), (9.0, True, 0.49)) == [0.1]


def test_it_rings_again_only_where_it_has_come_closer_by_more_than_noise() -> None:
    closer = 0.49 - CLOSER_M
    assert rings((0.0, True, 0.49), (PAUSE_S, True, math.nextafter(closer, 1.0)), (3.0, True, closer)) == [
        0.0,
        3.0,
    ]


def test_a_pause_is_kept_while_it_closes() -> None:
    statuses = [(n / 10, True, 0.5 - n / 100) for n in range(45)]
    assert rings(*statuses) == [0.0, 2.0, 4.0]


def test_a_warning_that_flickers_does_not_rattle() -> None:
    assert rings(*[(n / 10, n % 2 == 0, 0.5) for n in range(40)]) == [0.0, 2.0]


def test_an_edge_within_the_pause_rings_after_it() -> None:
    assert rings((0.0, True, 0.49), (0.5, False, 0.6), (1.0, True, 0.49), (2.1, True, 0.49)) == [0.0, 2.1]


def test_an_unknown_distance_rings_at_the_edge_alone() -> None:
    assert rings((0.0, True, math.nan), (3.0, True, math.nan)) == [0.0]
