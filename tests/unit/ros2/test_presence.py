"""Which programs publish on the topic of a source, and which of them are alive."""

import asyncio

import pytest

from ros2 import guard
from ros2.presence import Presence, Programs
from ros2.ros import TWIST, TWIST_STAMPED, Endpoint
from tests.unit.ros2.fake_ros import NAME, FakeRos
from tests.unit.ros2.processes import LIMIT_S, OWN_GID, Child, gid_of, go_on, stop

TOPIC, CMD_VEL = "/teleop/cmd_vel", "/cmd_vel"
A, B = (Endpoint(name, TWIST, bytes([9]) * 15 + bytes([place])) for place, name in enumerate(("/a", "/b")))


class Watched:
    """One watched topic; `changes` has the identity of the only live program at each change."""

    def __init__(self, *listed: Endpoint) -> None:
        self.ros = FakeRos()
        self.ros.listed[CMD_VEL] = [Endpoint(NAME, TWIST, OWN_GID)]
        self.changes: list[bytes | None] = []
        self.changed = asyncio.Event()
        self.presence = Presence(self.ros, self._on_change)
        self.programs = self.presence.watch(TOPIC, TWIST)
        self.presence.others(CMD_VEL)
        self.list(*listed)

    def _on_change(self, programs: Programs) -> None:
        assert programs is self.programs
        self.changes.append(programs.only)
        self.changed.set()

    def list(self, *endpoints: Endpoint) -> bytes | None:
        """Set what discovery knows, and look."""
        self.ros.listed[TOPIC] = list(endpoints)
        self.presence.look()
        return self.programs.only

    async def next_change(self) -> bytes | None:
        self.changed.clear()
        async with asyncio.timeout(LIMIT_S):
            await self.changed.wait()
        return self.programs.only


async def test_exactly_one_program_of_the_expected_type_is_alone() -> None:
    watched = Watched()
    wrong = B._replace(type_name=TWIST_STAMPED)
    assert [watched.list(), watched.list(A), watched.list(A, B), watched.list(B)] == [
        None,
        A.gid,
        None,
        B.gid,
    ]
    assert watched.list(wrong) is None
    assert watched.list(A, wrong) == A.gid
    assert (watched.programs.everyone, watched.programs.live) == ([A, wrong], [A])
    assert watched.programs.pid is None


async def test_two_publishers_of_one_process_are_two_programs() -> None:
    assert Watched(A, A._replace(gid=B.gid)).programs.only is None


async def test_every_look_reports_the_topic_so_that_no_change_is_missed() -> None:
    watched = Watched(A)
    watched.list(B)
    assert watched.changes == [A.gid, B.gid]


async def test_a_killed_program_is_gone_at_once_although_discovery_still_lists_it(
    child: Child,
) -> None:
    program = Endpoint("/teleop", TWIST, gid_of(child.pid))
    watched = Watched(program)
    assert watched.programs.pid == child.pid
    child.kill()
    assert await watched.next_change() is None
    assert watched.list(program) is None, "it is still listed"
    assert watched.programs.everyone == []
    restarted = Endpoint("/teleop", TWIST, B.gid)
    assert watched.list(program, restarted) == B.gid
    assert watched.list(restarted) == B.gid


async def test_an_identity_that_was_no_longer_listed_may_return(child: Child) -> None:
    program = Endpoint("/teleop", TWIST, gid_of(child.pid))
    watched = Watched(program)
    child.kill()
    await watched.next_change()
    assert watched.list() is None
    assert watched.list(program) == program.gid


async def test_the_death_of_a_program_that_was_not_alone_is_not_reported(
    child: Child,
) -> None:
    program = Endpoint("/teleop", TWIST, gid_of(child.pid))
    watched = Watched(program)
    watched.list(program, A)
    child.kill()
    assert await watched.next_change() == A.gid


async def test_a_stopped_program_is_not_alone_until_it_continues(child: Child) -> None:
    program = Endpoint("/teleop", TWIST, gid_of(child.pid))
    watched = Watched(program)
    watched.changes.clear()
    watched.presence.poll()
    assert watched.changes == []
    stop(child)
    watched.presence.poll()
    watched.presence.poll()
    assert watched.changes == [None]
    assert watched.programs.stopped
    go_on(child)
    watched.presence.poll()
    assert watched.changes == [None, program.gid]


async def test_a_program_that_is_no_longer_listed_is_not_watched(
    child: Child, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = Endpoint("/teleop", TWIST, gid_of(child.pid))
    watched = Watched(program)
    watched.list()

    def fail(_: int) -> None:
        raise AssertionError("it is looked at")

    monkeypatch.setattr(guard, "is_stopped", fail)
    watched.presence.poll()


# --- the token of `lifeline ros2 exec`


async def test_a_program_ends_with_the_token_of_its_wrapper() -> None:
    watched = Watched(A)
    watched.presence.wrapper(watched.programs, alive=True)
    assert watched.programs.wrapped
    assert watched.programs.only == A.gid
    watched.presence.wrapper(watched.programs, alive=False)
    assert not watched.programs.wrapped
    assert watched.programs.only is None
    assert watched.list(A) is None, "it is still listed"
    assert watched.list(A, B) == B.gid, "its next run"


async def test_a_program_is_served_again_when_the_token_of_its_wrapper_returns() -> None:
    """As after a restart of the supervisor, when all tokens go and return."""
    watched = Watched(A)
    for alive in (True, False, True):
        watched.presence.wrapper(watched.programs, alive=alive)
    assert watched.programs.only == A.gid


async def test_a_flapping_token_beside_another_program_serves_neither() -> None:
    watched = Watched(A)
    watched.presence.wrapper(watched.programs, alive=False)
    assert watched.list(A, B) == B.gid
    watched.presence.wrapper(watched.programs, alive=True)
    assert watched.programs.only is None
    assert watched.programs.live == [A, B]


async def test_a_killed_program_with_two_publishers_does_not_hinder_its_successor(child: Child) -> None:
    both = [Endpoint("/a", TWIST, gid_of(child.pid, entity)) for entity in (1, 2)]
    watched = Watched(*both, B)
    assert watched.programs.only is None
    child.kill()
    while watched.programs.only is None:
        await watched.next_change()
    assert watched.programs.only == B.gid


async def test_the_end_of_a_wrapper_is_forgotten_with_its_program() -> None:
    watched = Watched(A)
    watched.presence.wrapper(watched.programs, alive=False)
    watched.list()
    assert watched.list(A) == A.gid


# --- the robot's command topic


async def test_the_publishers_of_other_processes_are_the_others() -> None:
    watched = Watched()
    own = watched.ros.listed[CMD_VEL][0]
    assert watched.presence.others(CMD_VEL) == []
    sibling = Endpoint("/lifeline_services", TWIST, own.gid[:12] + b"9999")
    watched.ros.listed[CMD_VEL] = [own, sibling, A]
    assert watched.presence.others(CMD_VEL) == [A]


async def test_a_second_process_with_a_node_of_the_same_name_is_another_one(child: Child) -> None:
    watched = Watched()
    second = Endpoint(NAME, TWIST, gid_of(child.pid))
    fresh = Presence(watched.ros, lambda _: None)
    watched.ros.listed[CMD_VEL].insert(0, second)
    assert fresh.others(CMD_VEL) == [second]


async def test_before_discovery_knows_the_own_publisher_all_others_are_reported() -> None:
    watched = Watched()
    fresh = Presence(watched.ros, lambda _: None)
    watched.ros.listed[CMD_VEL] = [A]
    assert fresh.others(CMD_VEL) == [A]


async def test_a_dead_publisher_of_the_command_topic_is_no_other(child: Child) -> None:
    program = Endpoint("/teleop", TWIST, gid_of(child.pid))
    watched = Watched(program)
    watched.ros.listed[CMD_VEL].append(program)
    assert watched.presence.others(CMD_VEL) == [program]
    child.kill()
    await watched.next_change()
    assert watched.presence.others(CMD_VEL) == []
