"""What a page at the wheel may request: with a new picture, forward in its own time, and after its own zero."""

import asyncio
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from station.driving import MAX_PICTURES, STALE_S, Commands, Driving, Pictures
from station.messages import BadMessageError, Wanted, read_wanted

ZERO = (0.0, 0.0)


class Record:
    """A wheel that records what it gets."""

    def __init__(self) -> None:
        self.sent, self.is_taken, self.refuses = list[tuple[float, float, float]](), False, ""

    async def take(self) -> str:
        self.is_taken = True
        return self.refuses

    def put(self, linear: float, angular: float, true_at_s: float) -> None:
        self.sent.append((linear, angular, true_at_s))

    async def reset(self) -> str:
        return ""

    def release(self) -> None:
        self.is_taken = False

    @property
    def newest(self) -> tuple[float, float]:
        return self.sent[-1][:2]


def shown(scan_s: float, number: int = 1) -> Pictures:
    pictures = Pictures()
    pictures.sent(number, scan_s)
    return pictures


def test_motion_is_sent_on_with_the_pages_own_time_after_a_zero() -> None:
    wheel = Record()
    commands, pictures = Commands(wheel), shown(100.0)
    assert commands.hear(Wanted(0.0, 0.0, 7.0, 1), pictures, 100.0) == ""
    assert commands.hear(Wanted(0.5, -1.0, 7.1, 1), pictures, 100.25) == ""
    assert wheel.sent == [(0.0, 0.0, 100.0), (0.5, -1.0, pytest.approx(100.1))]


def test_motion_as_the_first_command_is_zero_until_the_page_has_sent_zero() -> None:
    wheel = Record()
    commands, pictures = Commands(wheel), shown(100.0)
    assert commands.hear(Wanted(0.5, 0.0, 7.0, 1), pictures, 100.0) == "Let go first."
    assert wheel.newest == ZERO


@pytest.mark.parametrize(("age_s", "moves"), [(0.0, True), (STALE_S, True), (STALE_S + 0.01, False)])
def test_the_age_of_the_picture_counts_from_its_scan(age_s: float, moves: bool) -> None:  # noqa: FBT001
    wheel = Record()
    commands, pictures = Commands(wheel), shown(100.0)
    commands.hear(Wanted(0.0, 0.0, 7.0, 1), pictures, 100.0)
    commands.hear(Wanted(0.5, 0.0, 7.1, 1), pictures, 100.0 + age_s)
    assert (wheel.newest == (0.5, 0.0)) is moves


@pytest.mark.parametrize("pictures", [None, Pictures(), shown(100.0, 2), shown(-math.inf)])
def test_without_a_picture_of_this_number_nothing_moves(pictures: Pictures | None) -> None:
    wheel = Record()
    commands = Commands(wheel)
    commands.hear(Wanted(0.0, 0.0, 7.0, 1), pictures, 100.0)
    assert commands.hear(Wanted(0.5, 0.0, 7.1, 1), pictures, 100.1) == "The robot is not seen."
    assert wheel.newest == ZERO


def test_after_a_refusal_only_the_pages_own_zero_permits_motion() -> None:
    wheel = Record()
    commands, pictures = Commands(wheel), shown(100.0)
    commands.hear(Wanted(0.0, 0.0, 7.0, 1), pictures, 100.0)
    assert commands.hear(Wanted(0.5, 0.0, 8.0, 1), pictures, 101.0) == "The picture is 1.0 s old."
    pictures.sent(2, 101.0)
    assert commands.hear(Wanted(0.5, 0.0, 8.1, 2), pictures, 101.1) == "Let go first."
    assert wheel.newest == ZERO
    commands.hear(Wanted(0.0, 0.0, 8.2, 2), pictures, 101.2)
    assert commands.hear(Wanted(0.5, 0.0, 8.2, 2), pictures, 101.2) == ""
    assert wheel.newest == (0.5, 0.0)


def test_time_that_goes_back_is_no_command() -> None:
    commands = Commands(Record())
    commands.hear(Wanted(0.0, 0.0, 7.0, 1), None, 100.0)
    with pytest.raises(BadMessageError):
        commands.hear(Wanted(0.0, 0.0, 6.99, 1), None, 100.1)


def test_only_the_newest_pictures_are_remembered() -> None:
    pictures = Pictures()
    for number in range(1, MAX_PICTURES + 2):
        pictures.sent(number, 100.0)
    assert pictures.age_s(1, 100.0) == math.inf
    assert pictures.age_s(2, 100.5) == 0.5


moments = st.lists(
    st.tuples(
        st.sampled_from([0.0, 0.03, 0.2, 0.5]),  # since the last command
        st.sampled_from([0.0, 0.4, -1.0]),
        st.booleans(),  # whether a new picture was drawn before
    ),
    max_size=60,
)


@given(moments)
def test_whatever_happens_motion_has_a_new_picture_and_a_zero_of_the_person_since_the_last_refusal(
    life: list[tuple[float, float, bool]],
) -> None:
    wheel, pictures, now_s, number = Record(), Pictures(), 100.0, 0
    commands = Commands(wheel)
    scan_s, may_move = -math.inf, False
    for passed_s, linear, is_drawn in life:
        now_s += passed_s
        if is_drawn:
            number, scan_s = number + 1, now_s
            pictures.sent(number, scan_s)
        commands.hear(Wanted(linear, 0.0, now_s - 50.0, number), pictures, now_s)
        is_new = now_s - scan_s <= STALE_S
        may_move = linear == 0.0 or (may_move and is_new)
        assert wheel.newest == ((linear, 0.0) if may_move else ZERO)


async def test_a_page_at_the_wheel_commands_and_resets() -> None:
    wheel = Record()
    driving = Driving(wheel)
    assert await driving.take("a") == ""
    driving.commands().hear(Wanted(0.0, 0.0, 7.0, 1), None, 100.0)
    assert wheel.sent == [(0.0, 0.0, 100.0)]
    assert await driving.reset() == ""


async def test_one_page_at_a_time_has_the_wheel() -> None:
    wheel = Record()
    driving = Driving(wheel)
    assert await driving.take("a") == ""
    assert await driving.take("b") == "Another page drives."
    driving.release("b")
    assert wheel.is_taken
    driving.release("a")
    assert not wheel.is_taken
    assert await driving.take("b") == ""


async def test_a_wheel_that_another_program_holds_is_released_again() -> None:
    wheel = Record()
    wheel.refuses = "The robot is driven by the teleop of x."
    driving = Driving(wheel)
    assert await driving.take("a") == wheel.refuses
    driving.release("a")
    wheel.refuses = ""
    assert await driving.take("b") == ""


async def test_pages_that_come_at_the_same_time_do_not_share_the_wheel() -> None:
    driving = Driving(Record())
    answers = await asyncio.gather(*(driving.take(page) for page in "abc"))
    assert sorted(answers) == ["", "Another page drives.", "Another page drives."]


@given(st.text(max_size=80))
def test_any_text_is_a_command_or_no_message(text: str) -> None:
    try:
        wanted = read_wanted(text)
    except BadMessageError:
        return
    assert wanted is None or abs(wanted.linear) <= 1.0


def test_a_reset_is_no_command() -> None:
    assert read_wanted('{"reset": true}') is None
    with pytest.raises(BadMessageError):
        read_wanted('{"reset": false}')
