"""What the hands at a page want, in JavaScript: zero unless exactly one thing is held, for any sequence of events."""

import math
import random
from typing import Any

import pytest

from tests.unit.station.test_page_lease import in_node

PROGRAM = """
import { readFileSync } from "node:fs";
import * as wishes from "./wish.js";
const step = (wish, [name, ...parts]) => wishes[name](wish, ...parts);
const run = ([events, level]) => {
  let wish = wishes.NOTHING;
  return events.map((event) => {
    wish = step(wish, event);
    return [wish, wishes.wanted(wish, level)];
  });
};
console.log(JSON.stringify(JSON.parse(readFileSync(0)).map(run)));
"""
SEQUENCES, EVENTS = 300, 40
BUTTONS = [False, False, False, False, True]
FREE = ["padRead", {"index": 0, "buttons": [False] * 5, "axes": [0, 0]}]
AHEAD = ["padRead", {"index": 0, "buttons": BUTTONS, "axes": [0, -1]}]
OTHER = ["padRead", {"index": 1, "buttons": BUTTONS, "axes": [0, -1]}]
PULLED = ["pulled", 1, 0, 1, True]
W, S, A, D = (["keyHeld", f"Key{name}", True] for name in "WSAD")
UNCOUNTED = ["keyHeld", "KeyW", False]
Event = list[Any]


def run(*lives: tuple[list[Event], float]) -> list[list[tuple[dict[str, Any], list[float]]]]:
    """Return the state and the wanted shares after each event of each life."""
    return in_node(PROGRAM, lives)


def wanted(*events: Event, level: float = 5) -> list[float]:
    return run((list(events), level))[0][-1][1]


@pytest.mark.parametrize(
    ("events", "share"),
    [
        ([W], [1, 0]),
        ([W, A], [1, 1]),
        ([W, S], [0, 0]),
        ([S, D], [-1, -1]),
        ([W, ["keyLifted", "KeyW"]], [0, 0]),
        ([W, ["keyHeld", "ArrowUp", True], ["keyLifted", "KeyW"]], [1, 0]),
        ([["keyHeld", "KeyQ", True]], [0, 0]),
        ([["pulled", 1, 0, 1, False]], [1, 0]),
        ([["pulled", 1, -1, 0, False]], [0, 1]),
        ([["pulled", 1, 0, 9, False]], [1, 0]),
        ([["pulled", 1, 0.1, 0.1, False]], [0, 0]),
        ([["pulled", 1, 0, 1, True]], [0, 0]),
        ([["enabled", 2]], [0, 0]),
        ([["enabled", 2], ["pulled", 1, 0, 1, True]], [1, 0]),
        ([["enabled", 1], ["pulled", 1, 0, 1, True]], [0, 0]),
        ([["enabled", 2], ["pulled", 1, 0, 1, True], ["lifted", 2]], [0, 0]),
        ([["enabled", 2], ["pulled", 1, 0, 1, True], ["lifted", 1]], [0, 0]),
        ([["enabled", 2], ["pulled", 1, 0, 1, True], ["lifted", 3]], [1, 0]),
        ([["pulled", 1, 0, 1, False], ["moved", 1, 0, -1]], [-1, 0]),
        ([["pulled", 1, 0, 1, False], ["moved", 2, 0, -1]], [1, 0]),
        ([["pulled", 1, 0, 1, False], W], [0, 0]),
        ([FREE, AHEAD], [1, 0]),
        ([FREE, ["padRead", {"index": 0, "buttons": [False] * 5, "axes": [0, -1]}]], [0, 0]),
        ([FREE, ["padRead", {"index": 0, "buttons": BUTTONS, "axes": []}]], [0, 0]),
        ([FREE, AHEAD, ["padRead", None]], [0, 0]),
        ([FREE, AHEAD, ["pulled", 1, 0, 1, False]], [0, 0]),
        ([W, ["forgotten"]], [0, 0]),
    ],
)
def test_motion_lasts_while_one_thing_is_held(events: list[Event], share: list[float]) -> None:
    assert wanted(*events) == share


@pytest.mark.parametrize(
    "before",
    [
        [],
        [FREE, AHEAD, ["forgotten"]],
        [FREE, ["forgotten"]],
        [FREE, AHEAD, ["padRead", None]],
        [FREE, ["padRead", None]],
        [FREE, OTHER],
        [FREE, AHEAD, OTHER],
    ],
)
def test_a_gamepad_that_is_held_when_it_comes_or_after_a_stop_drives_only_after_its_button_was_released(
    before: list[Event],
) -> None:
    assert wanted(*before, AHEAD, AHEAD) == [0, 0]
    assert wanted(*before, AHEAD, FREE, AHEAD) == [1, 0]


def test_after_the_enable_button_was_released_the_stick_must_be_touched_again() -> None:
    released: list[Event] = [["enabled", 2], PULLED, ["lifted", 2], ["enabled", 2]]
    assert wanted(*released) == wanted(*released, ["moved", 1, 0, 1]) == [0, 0]
    assert wanted(*released, PULLED) == [1, 0]


@pytest.mark.parametrize("before", [[W, ["forgotten"]], [W, ["forgotten"], ["forgotten"]], [UNCOUNTED]])
def test_a_key_that_is_held_without_counting_drives_only_after_its_release_was_seen(
    before: list[Event],
) -> None:
    """A browser may report a held key as newly pressed when the page gets the focus again."""
    for again in ([W], [["keyLifted", "KeyA"], W]):
        assert wanted(*before, *again) == [0, 0]
    assert wanted(*before, A) == [0, 1]
    assert wanted(*before, ["keyLifted", "KeyW"], W) == [1, 0]


def test_the_speed_level_scales_both_velocities() -> None:
    assert wanted(W, A, level=2) == pytest.approx([0.4, 0.4])
    assert wanted(W, level=float(10**9)) == [1, 0]


def test_no_sequence_of_events_moves_without_a_hand() -> None:
    chance = random.Random(1)
    lives = [([event(chance) for _ in range(EVENTS)], chance.choice([1, 3, 5])) for _ in range(SEQUENCES)]
    for states in run(*lives):
        for wish, (linear, angular) in states:
            assert math.isfinite(linear)
            assert max(abs(linear), abs(angular)) <= 1.0
            stick = wish["stick"]
            has_thumbs = stick is not None and (
                not stick["isTouch"] or wish["enable"] not in (None, stick["pointer"])
            )
            if (linear, angular) != (0, 0):
                assert wish["pad"] is None or wish["freePad"] is not None
                assert set(wish["keys"]) <= set(wish["down"])
                assert has_thumbs + bool(wish["keys"]) + (wish["pad"] is not None) == 1


def event(chance: random.Random) -> Event:
    pointer, place = chance.randrange(1, 4), [round(chance.uniform(-1.5, 1.5), 2) for _ in range(2)]
    code = chance.choice(["KeyW", "KeyA", "KeyS", "ArrowUp", "KeyX"])
    buttons, index = chance.choice([BUTTONS, []]), chance.randrange(2)
    pad = chance.choice([None, {"index": index, "buttons": buttons, "axes": place}])
    return chance.choice(
        [
            ["enabled", pointer],
            ["pulled", pointer, *place, chance.random() < 0.5],
            ["moved", pointer, *place],
            ["lifted", pointer],
            ["keyHeld", code, chance.random() < 0.8],
            ["keyLifted", code],
            ["padRead", pad],
            ["forgotten"],
        ]
    )
