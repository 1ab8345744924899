"""What a page at the wheel may request: with a new picture, forward in its own time, and after its own zero."""

import asyncio
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from station.driving import IDLE_S, LEFT, MAX_PICTURES, STALE_S, Commands, Driving, Person, Pictures
from station.messages import BadMessageError, Wanted

ZERO = (0.0, 0.0)
HANDED_OVER = "You handed over to Ben. Press Drive to drive again."
ZERO_WANTED, MOTION = Wanted(0.0, 0.0, 7.0, 1), Wanted(0.5, 0.0, 7.0, 1)


class Record:
    """A wheel that records what it gets."""

    def __init__(self) -> None:
        self.sent, self.is_taken, self.refuses = list[tuple[float, float, float]](), False, ""
        self.is_contested = False
        self.acts = list[str]()

    async def take(self) -> str:
        self.is_taken = True
        return self.refuses

    def put(self, linear: float, angular: float, true_at_s: float) -> None:
        self.sent.append((linear, angular, true_at_s))

    async def reset(self) -> str:
        return ""

    def release(self) -> None:
        self.is_taken = False

    def record(self, page: object, act: str) -> None:
        self.acts.append(act)

    @property
    def newest(self) -> tuple[float, float]:
        return self.sent[-1][:2]


def shown(scan_s: float, number: int = 1) -> Pictures:
    pictures = Pictures()
    pictures.sent(number, scan_s)
    return pictures


async def asked() -> tuple[Record, Driving, Person, Person]:
    """Anna has driven since 100 s, and Ben asks."""
    wheel = Record()
    driving = Driving(wheel)
    anna = driving.enter("Anna", "Anna's page")
    await driving.take(anna, 100.0)
    return wheel, driving, anna, driving.enter("Ben", "Ben's page")


def turn(driving: Driving, person: Person, now_s: float) -> tuple[object, object, object]:
    """Whether a page drives, who asks it to hand over, and what it shows."""
    fields = driving.turn(person, now_s)
    return fields["drives"], fields["asker"], fields["sentence"]


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
    assert commands.hear(Wanted(0.5, 0.0, 7.1, 1), pictures, 100.1).startswith("The robot is not seen:")
    assert wheel.newest == ZERO


def test_after_a_refusal_only_the_pages_own_zero_permits_motion() -> None:
    wheel = Record()
    commands, pictures = Commands(wheel), shown(100.0)
    commands.hear(Wanted(0.0, 0.0, 7.0, 1), pictures, 100.0)
    assert commands.hear(Wanted(0.5, 0.0, 8.0, 1), pictures, 101.0).startswith("The picture is 1.0 s old:")
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


async def test_the_driver_commands_and_resets() -> None:
    wheel = Record()
    driving = Driving(wheel)
    anna = driving.enter("Anna", "Anna's page")
    assert await driving.take(anna, 100.0) == ""
    driving.hear(anna, ZERO_WANTED, None, 100.0)
    assert wheel.sent == [(0.0, 0.0, 100.0)]
    assert await driving.reset(anna) == ""
    assert wheel.acts == ["Anna began to drive", "Anna requested a reset"]


async def test_a_person_who_asks_moves_nothing_and_resets_nothing_until_the_driver_leaves() -> None:
    wheel, driving, anna, ben = await asked()
    assert await driving.take(ben, 101.0) == ""
    driving.hear(ben, MOTION, shown(101.0), 101.0)
    assert await driving.reset(ben) == "Only the driver resets: wait until you drive."
    assert (driving.driver, wheel.sent, wheel.is_taken) == ("Anna", [], True)
    driving.leave(anna)
    assert (driving.driver, wheel.is_taken) == ("", False)
    assert await driving.take(ben, 101.1) == ""
    assert (driving.driver, wheel.is_taken) == ("Ben", True)


async def test_a_hand_over_ends_the_permission_at_once_and_the_next_person_begins_with_a_zero() -> None:
    wheel, driving, anna, ben = await asked()
    driving.hear(anna, ZERO_WANTED, shown(101.0), 101.0)
    driving.hear(anna, MOTION, shown(101.0), 101.0)
    assert driving.ending(anna, 101.0, "Ben") == HANDED_OVER
    driving.leave(anna)
    assert not wheel.is_taken
    wheel.sent.clear()
    await driving.take(ben, 101.0)
    driving.hear(anna, MOTION, shown(101.0), 101.1)
    assert wheel.sent == [], "moved by the hand-over, or by the person who handed over"
    assert driving.hear(ben, MOTION, shown(101.0), 101.1) == "Let go first."
    assert wheel.newest == ZERO
    assert wheel.acts == [
        "Anna began to drive",
        "Ben asked to drive",
        "Anna handed over to Ben",
        "Ben began to drive",
    ]


async def test_a_request_never_ends_the_turn_of_a_driver_who_moves_the_robot() -> None:
    _, driving, anna, _ = await asked()
    driving.hear(anna, ZERO_WANTED, None, 100.0)
    for second in range(1, 300):
        driving.hear(anna, MOTION, shown(100.0 + second), 100.0 + second)
        assert driving.ending(anna, 100.0 + second) == ""


@pytest.mark.parametrize(("idle_s", "ends"), [(IDLE_S, False), (math.nextafter(IDLE_S, math.inf), True)])
async def test_a_driver_without_motion_loses_control_after_the_shown_time(idle_s: float, ends: bool) -> None:  # noqa: FBT001
    wheel = Record()
    driving = Driving(wheel)
    anna = driving.enter("Anna", "Anna's page")
    await driving.take(anna, 0.0)
    driving.hear(anna, ZERO_WANTED, shown(0.0), idle_s)
    assert (driving.ending(anna, idle_s) != "") is ends
    driving.leave(anna)
    assert wheel.acts[-1] == ("Anna lost control after 30 s without motion" if ends else "Anna ended driving")


async def test_a_driver_whose_source_another_program_has_taken_loses_control() -> None:
    wheel, driving, anna, ben = await asked()
    wheel.is_contested = True
    assert driving.ending(ben, 101.0) == ""
    assert driving.ending(anna, 101.0) == "You lost control to another program. Press Drive to drive again."
    driving.leave(anna)
    assert wheel.acts[-1] == "Anna lost control to another program"


async def test_motion_begins_the_time_again_and_zero_does_not() -> None:
    _, driving, anna, ben = await asked()
    driving.hear(anna, ZERO_WANTED, shown(110.0), 110.0)
    assert turn(driving, ben, 110.0) == (
        False,
        "",
        "Wait for Anna, who loses control after 20 s without motion.",
    )
    driving.hear(anna, MOTION, shown(110.0), 110.0)
    assert turn(driving, ben, 110.0) == (
        False,
        "",
        "Wait for Anna, who loses control after 30 s without motion.",
    )


@pytest.mark.parametrize("pictures", [None, shown(0.0)])
async def test_motion_that_is_refused_does_not_keep_the_wheel(pictures: Pictures | None) -> None:
    _, driving, anna, _ = await asked()
    driving.hear(anna, ZERO_WANTED, None, 100.0)
    for second in range(1, int(IDLE_S) + 1):
        assert driving.hear(anna, MOTION, pictures, 100.0 + second) != ""
    assert driving.ending(anna, 100.5 + IDLE_S) != ""


async def test_the_driver_sees_who_asks_and_may_hand_over_only_to_a_person() -> None:
    _, driving, anna, ben = await asked()
    assert turn(driving, anna, 104.5) == (
        True,
        "Ben",
        "Ben asks to drive: hand over, or drive on within 26 s.",
    )
    driving.leave(ben)
    assert turn(driving, anna, 104.5) == (True, "", "")
    assert driving.ending(anna, 104.5, "Ben") == ""
    driving.leave(anna)
    cleo = driving.enter("Cleo", "Cleo's page")
    assert turn(driving, cleo, 104.5) == (False, "", "")
    assert driving.ending(cleo, 1000.0, "Cleo") == "", "a person who asks has nothing to hand over"


async def test_a_hand_over_to_a_person_who_has_left_meanwhile_gives_the_wheel_to_nobody_else() -> None:
    _, driving, anna, ben = await asked()
    cleo = driving.enter("Cleo", "Cleo's page")
    driving.leave(ben)
    for name in ("Ben", "Anna", "", "Cleo\n"):
        assert driving.ending(anna, 101.0, name) == ""
    await driving.take(cleo, 101.0)
    assert driving.driver == "Anna"
    assert driving.ending(anna, 101.0, "Cleo").startswith("You handed over to Cleo.")


async def test_nobody_gets_the_wheel_by_a_hand_over_to_a_person_who_leaves_before_the_first_message() -> None:
    wheel, driving, anna, ben = await asked()
    cleo = driving.enter("Cleo", "Cleo's page")
    assert driving.ending(anna, 101.0, "Ben") == HANDED_OVER
    driving.leave(anna)
    dora = driving.enter("Dora", "Dora's page")
    driving.leave(ben)
    for asks in (cleo, dora):
        assert await driving.take(asks, 101.1) == ""
        assert (driving.driver, wheel.is_taken) == ("", False)
        assert driving.ending(asks, 101.1) == LEFT
        driving.leave(asks)
    again = driving.enter("Cleo", "Cleo's page")
    await driving.take(again, 102.0)
    assert driving.driver == "Cleo"


async def test_nobody_gets_the_wheel_by_a_hand_over_to_a_person_who_cannot_take_it() -> None:
    wheel, driving, anna, ben = await asked()
    cleo = driving.enter("Cleo", "Cleo's page")
    assert driving.ending(anna, 101.0, "Ben") == HANDED_OVER
    driving.leave(anna)
    wheel.refuses = "Another program drives."
    assert await driving.take(ben, 101.0) == wheel.refuses
    driving.leave(ben)
    wheel.refuses = ""
    await driving.take(cleo, 101.1)
    assert (driving.driver, driving.ending(cleo, 101.1)) == ("", LEFT)


async def test_after_a_hand_over_the_next_person_drives_when_the_turn_that_it_began_has_ended() -> None:
    _, driving, anna, ben = await asked()
    cleo = driving.enter("Cleo", "Cleo's page")
    assert driving.ending(anna, 101.0, "Ben") == HANDED_OVER
    driving.leave(anna)
    await driving.take(ben, 101.0)
    driving.leave(ben)
    await driving.take(cleo, 102.0)
    assert (driving.driver, driving.ending(cleo, 102.0)) == ("Cleo", "")


async def test_persons_drive_in_the_order_in_which_they_asked() -> None:
    _, driving, anna, ben = await asked()
    cleo = driving.enter("Cleo", "Cleo's page")
    assert driving.ending(anna, 101.0, "Ben") == HANDED_OVER
    driving.leave(anna)
    await driving.take(cleo, 101.0)
    assert driving.driver == ""
    await driving.take(ben, 101.0)
    assert driving.driver == "Ben"


async def test_a_page_has_one_place_and_gets_a_new_one_at_the_end_of_the_queue() -> None:
    _, driving, anna, ben = await asked()
    assert driving.has(anna.page)
    assert driving.has(ben.page)
    assert not driving.has("Cleo's page")
    driving.leave(ben)
    assert not driving.has(ben.page)
    cleo = driving.enter("Cleo", "Cleo's page")
    again = driving.enter("Ben", ben.page)
    driving.leave(anna)
    await driving.take(again, 101.0)
    assert driving.driver == ""
    await driving.take(cleo, 101.0)
    assert driving.driver == "Cleo"


async def test_a_name_has_one_place_so_that_a_hand_over_names_one_person() -> None:
    _, driving, anna, ben = await asked()
    assert driving.has_name("Anna")
    assert driving.has_name("BEN")
    assert not driving.has_name("Cleo")
    driving.leave(ben)
    assert not driving.has_name("Ben")
    driving.leave(anna)
    assert not driving.has_name("Anna")


async def test_a_wheel_that_another_program_holds_is_released_again() -> None:
    wheel = Record()
    wheel.refuses = "The robot is driven by the teleop of x."
    driving = Driving(wheel)
    anna = driving.enter("Anna", "Anna's page")
    assert await driving.take(anna, 100.0) == wheel.refuses
    driving.leave(anna)
    assert (wheel.is_taken, wheel.acts) == (False, []), "who never drove is not recorded as a driver"
    wheel.refuses = ""
    assert await driving.take(driving.enter("Ben", "Ben's page"), 100.0) == ""


async def test_pages_that_come_at_the_same_time_do_not_share_the_wheel() -> None:
    driving = Driving(Record())
    people = [driving.enter(name, name) for name in ("Anna", "Ben", "Cleo")]
    await asyncio.gather(*(driving.take(person, 100.0) for person in reversed(people)))
    assert driving.driver == "Anna"
