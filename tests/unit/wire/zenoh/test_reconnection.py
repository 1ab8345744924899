"""Samples after a reconnection: refused only from a hub that was there before, and only until it has settled."""

import math

from wire.zenoh.reconnection import Reconnection


def test_samples_count_before_and_after_the_first_connection() -> None:
    connection = Reconnection(0.4)
    assert connection.is_settled(5.0)
    connection.opened("a", 5.0)
    assert connection.is_settled(5.0)


def test_samples_after_a_reconnection_to_the_same_hub_count_once_it_has_settled() -> None:
    connection = Reconnection(0.5)
    connection.opened("a", 1.0)
    connection.opened("a", 5.0)
    assert not connection.is_settled(5.0)
    assert not connection.is_settled(math.nextafter(5.5, 0.0))
    assert connection.is_settled(5.5)


def test_each_further_reconnection_begins_anew() -> None:
    connection = Reconnection(0.5)
    for at_s in (1.0, 5.0, 5.25):
        connection.opened("a", at_s)
    assert not connection.is_settled(5.5)
    assert connection.is_settled(5.75)


def test_samples_of_a_restarted_hub_count_at_once() -> None:
    connection = Reconnection(0.5)
    connection.opened("a", 1.0)
    connection.opened("b", 5.0)
    assert connection.is_settled(5.0)
