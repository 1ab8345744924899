"""The network of the virtual campaign: measured properties of the real one, and all its faults."""

import asyncio
from random import Random
from typing import cast

import pytest

from virtual.loop import VirtualLoop, VirtualProcess
from virtual.network import HOP_S, VirtualBus, VirtualNetwork
from wire import topics
from wire.bus import Inbox, LivelinessChange, NoReplyError, Subscription
from wire.messages import Bool, TriggerResponse, Twist, planar_twist

COMMANDS = topics.source_cmd_vel("teleop")
LEASE_S = 0.4


class Bench:
    """A hub and two clients: teleop publishes, sim subscribes to the hub."""

    def __init__(self, loop: VirtualLoop) -> None:
        self.loop = loop
        self.network = VirtualNetwork(loop, Random(1), LEASE_S)
        self.process = VirtualProcess("supervisor")
        self.hub = self.network.open_hub("supervisor", self.process)
        self.teleop = self.network.open_client("teleop")
        self.sim = self.network.open_client("sim")
        self.heard: Subscription[Twist] = self.hub.subscribe(COMMANDS, depth=1000)
        self.obeyed: Subscription[Twist] = self.sim.subscribe(topics.CMD_VEL, depth=1000)
        self.alive = self.hub.watch_alive()
        self.sims_alive = self.sim.watch_alive()

    async def connect(self) -> None:
        await self.teleop.connect()
        await self.sim.connect()
        await asyncio.sleep(0.01)

    async def say(self, count: int, period_s: float = 0.05) -> None:
        publisher = self.teleop.publisher(COMMANDS)
        for number in range(1, count + 1):
            publisher.put(planar_twist(float(number), 0.0))
            await asyncio.sleep(period_s)

    def values(self) -> list[int]:
        return [int(a.message.linear.x) for a in self.heard.take() if a.message is not None]


@pytest.fixture
async def b() -> Bench:
    made = Bench(cast("VirtualLoop", asyncio.get_running_loop()))
    await made.connect()
    return made


def changes(inbox: Inbox[LivelinessChange]) -> list[tuple[str, bool]]:
    return [(change.node, change.alive) for change in inbox.take()]


async def test_a_sample_takes_one_hop_to_the_hub_and_two_to_another_client(b: Bench) -> None:
    others = b.sim.subscribe(COMMANDS)
    start_s = b.loop.time()
    await b.say(1)
    (arrival,), (relayed,) = b.heard.take(), others.take()
    assert arrival.arrival_s - start_s == pytest.approx(HOP_S)
    assert relayed.arrival_s - start_s == pytest.approx(2 * HOP_S)
    assert arrival.stamp is not None
    assert arrival.stamp.sequence == 1


async def test_nobody_but_the_hub_writes_cmd_vel_or_holds_the_supervisors_token(b: Bench) -> None:
    b.teleop.publisher(topics.CMD_VEL).put(planar_twist(1.0, 0.0))
    b.teleop.declare_alive(topics.SUPERVISOR)
    await asyncio.sleep(0.1)
    assert (b.obeyed.take(), changes(b.alive), b.network.refused) == ([], [], 2)
    b.hub.publisher(topics.CMD_VEL).put(planar_twist(0.5, 0.0))
    await asyncio.sleep(0.1)
    assert len(b.obeyed.take()) == 1


async def test_behind_a_router_the_supervisor_is_the_client_of_that_name(b: Bench) -> None:
    supervisor = b.network.open_joined(topics.SUPERVISOR)
    supervisor.publisher(topics.CMD_VEL).put(planar_twist(0.5, 0.0))
    supervisor.declare_alive(topics.SUPERVISOR)
    await asyncio.sleep(0.001)
    assert (len(b.obeyed.take()), b.sim.alive) == (1, [topics.SUPERVISOR])


async def test_a_listener_to_all_sources_hears_those_that_nobody_subscribes_to(b: Bench) -> None:
    for ears in (b.sim.hear_sources(), b.hub.hear_sources()):
        b.teleop.publisher(topics.source_cmd_vel("stranger")).put(planar_twist(0.0, 0.0))
        await asyncio.sleep(0.001)
        assert set(ears.take()) == {"stranger"}


async def test_a_cut_that_is_healed_within_the_lease_delivers_its_backlog_at_once_and_in_order(
    b: Bench,
) -> None:
    b.network.cut("teleop")
    await b.say(6)
    assert b.values() == []
    healed_s = b.loop.time()
    b.network.heal("teleop")
    await asyncio.sleep(0.25)
    arrivals = b.heard.take()
    assert [int(a.message.linear.x) for a in arrivals if a.message] == [1, 2, 3, 4, 5, 6]
    assert len({a.arrival_s for a in arrivals}) == 1
    assert 0.0 <= arrivals[0].arrival_s - healed_s <= 0.2


async def test_a_longer_cut_ends_the_session_and_the_client_comes_back_by_itself(b: Bench) -> None:
    b.teleop.declare_alive("teleop")
    await asyncio.sleep(0.01)
    b.network.cut("teleop")
    await asyncio.sleep(0.39)
    assert changes(b.alive) == [("teleop", True)]
    await asyncio.sleep(0.02)
    assert changes(b.alive) == [("teleop", False)]
    await asyncio.sleep(1.0)
    b.network.heal("teleop")
    await asyncio.sleep(0.25)
    assert changes(b.alive) == [("teleop", True)]
    await b.say(2)
    assert b.values() == [1, 2], "what the cut held up has gone with its session"


async def test_a_cut_of_one_direction_leaves_the_other_until_the_lease_ends(b: Bench) -> None:
    b.network.cut("teleop", up=False)
    await b.say(5)
    assert b.values() == [1, 2, 3, 4, 5]
    await b.say(5)
    assert b.values() == [1, 2, 3], "the client has given the session up"


async def test_a_killed_client_is_seen_to_be_gone_after_two_milliseconds(b: Bench) -> None:
    b.teleop.declare_alive("teleop")
    await asyncio.sleep(0.01)
    start_s = b.loop.time()
    b.teleop.die()
    await asyncio.sleep(0.05)
    *_, gone = b.alive.take()
    assert (gone.node, gone.alive) == ("teleop", False)
    assert gone.arrival_s - start_s == pytest.approx(0.002 + HOP_S)
    assert changes(b.sims_alive) == [("teleop", True), ("teleop", False)]
    b.teleop.publisher(COMMANDS).put(planar_twist(1.0, 0.0))
    await asyncio.sleep(0.05)
    assert b.values() == []


async def test_when_the_hub_dies_everybody_loses_everybody_and_finds_the_next_one(b: Bench) -> None:
    b.hub.declare_alive(topics.SUPERVISOR)
    b.teleop.declare_alive("teleop")
    await asyncio.sleep(0.01)
    assert changes(b.sims_alive) == [("supervisor", True), ("teleop", True)]
    b.hub.die()
    await asyncio.sleep(0.05)
    assert sorted(changes(b.sims_alive)) == [("supervisor", False), ("teleop", False)]
    hub = b.network.open_hub("supervisor")
    alive = hub.watch_alive()
    hub.declare_alive(topics.SUPERVISOR)
    await asyncio.sleep(0.25)
    assert sorted(changes(b.sims_alive)) == [("supervisor", True), ("teleop", True)]
    assert sorted(changes(alive)) == [("supervisor", True), ("teleop", True)]


async def test_a_held_process_hears_with_true_times_and_a_deaf_one_with_late_ones(b: Bench) -> None:
    await b.say(2)
    true_s = [a.arrival_s for a in b.heard.take()]
    assert true_s[1] - true_s[0] == pytest.approx(0.05)
    b.hub.set_deaf(deaf=True)
    await b.say(3)
    assert b.heard.take() == []
    b.hub.set_deaf(deaf=False)
    late_s = [a.arrival_s for a in b.heard.take()]
    assert late_s == [b.loop.time()] * 3


async def test_a_stopped_hub_is_given_up_after_the_lease_and_hears_its_backlog_when_it_wakes(
    b: Bench,
) -> None:
    b.hub.declare_alive(topics.SUPERVISOR)
    await asyncio.sleep(0.01)
    b.sims_alive.take()
    b.hub.set_stopped(stopped=True)
    await b.say(7)
    assert changes(b.sims_alive) == []
    await asyncio.sleep(0.1)
    assert changes(b.sims_alive) == [("supervisor", False)]
    b.hub.set_stopped(stopped=False)
    assert b.values() == [1, 2, 3, 4, 5, 6, 7]
    await asyncio.sleep(0.25)
    assert changes(b.sims_alive) == [("supervisor", True)]


async def test_a_flapping_token_goes_and_comes_back(b: Bench) -> None:
    b.teleop.declare_alive("teleop")
    await asyncio.sleep(0.01)
    b.network.flap("teleop")
    await asyncio.sleep(0.01)
    assert changes(b.alive) == [("teleop", True), ("teleop", False), ("teleop", True)]


async def test_a_lossy_link_loses_samples_but_no_token(b: Bench) -> None:
    up, _ = b.network.link("teleop")
    up.loss = 0.5
    b.teleop.declare_alive("teleop").withdraw()
    await b.say(100, 0.001)
    assert 20 < len(b.values()) < 80
    assert changes(b.alive) == [("teleop", True), ("teleop", False)]


@pytest.mark.parametrize("in_order", [True, False])
async def test_jitter_keeps_the_order_unless_it_is_set_not_to(b: Bench, in_order: bool) -> None:  # noqa: FBT001 - a parameter of a test
    up, _ = b.network.link("teleop")
    up.delay_s, up.jitter_s, up.in_order = 0.01, 0.2, in_order
    await b.say(30, 0.01)
    await asyncio.sleep(0.3)
    values = b.values()
    assert sorted(values) == list(range(1, 31))
    assert (values == sorted(values)) is in_order


async def test_a_flood_displaces_no_other_writers_sample(b: Bench) -> None:
    newest = b.hub.subscribe(COMMANDS, per_writer=True)
    await b.say(1)
    flood = b.sim.publisher(COMMANDS)
    for _ in range(100):
        flood.put(planar_twist(0.2, 0.0))
    await asyncio.sleep(0.01)
    taken = newest.take()
    assert [a.stamp.sequence for a in taken if a.stamp] == [1, 100]
    assert len({a.stamp.gid for a in taken if a.stamp}) == 2


async def test_a_step_of_the_senders_clock_shows_in_its_stamps_alone(b: Bench) -> None:
    publisher = b.teleop.publisher(COMMANDS)
    publisher.put(planar_twist(1.0, 0.0))
    b.teleop.clock_offset_s = 10.0
    publisher.put(planar_twist(1.0, 0.0))
    await asyncio.sleep(0.01)
    first, second = (a.stamp for a in b.heard.take())
    assert first is not None
    assert second is not None
    assert second.source_time_ns - first.source_time_ns == pytest.approx(10e9)


async def test_a_query_reaches_each_process_that_serves_and_the_first_answer_counts(b: Bench) -> None:
    async def quick(text: str) -> TriggerResponse:
        return TriggerResponse(success=True, message=f"hub: {text}")

    async def slow(_: str) -> TriggerResponse:
        await asyncio.sleep(0.1)
        return TriggerResponse(success=True, message="itself")

    service = topics.source_holder("teleop")
    b.hub.serve(service, quick)
    b.teleop.serve(service, slow)
    assert (await b.teleop.call(service, "hello")).message == "hub: hello"
    assert (await b.sim.call(service, "hello")).message == "hub: hello"
    b.process.hold()
    assert (await b.sim.call(service)).message == "itself"
    b.network.cut("teleop")
    with pytest.raises(NoReplyError, match="nobody answered"):
        await b.sim.call(service, timeout_s=0.5)


async def test_a_handler_that_fails_is_reported_with_its_process(b: Bench) -> None:
    async def fail(_: str) -> TriggerResponse:
        raise ZeroDivisionError

    told: list[tuple[str, type]] = []
    b.loop.on_error = lambda name, error: told.append((name, type(error)))
    b.hub.serve(topics.SUPERVISOR_RESET, fail)
    with pytest.raises(NoReplyError):
        await b.teleop.call(topics.SUPERVISOR_RESET)
    assert told == [("supervisor", ZeroDivisionError)]


async def test_what_nobody_listens_to_is_not_sent_but_still_tapped(b: Bench) -> None:
    tapped: list[tuple[str, str]] = []
    b.network.tap = lambda node, key, _message, _stamp: tapped.append((node, key))
    b.teleop.publisher(topics.ESTOP).put(Bool(data=True))
    assert tapped == [("teleop", topics.ESTOP.key)]


async def test_a_bus_that_has_left_in_order_is_gone_at_once(b: Bench) -> None:
    token = b.teleop.declare_alive("teleop")
    await asyncio.sleep(0.01)
    await b.teleop.close()
    await b.teleop.close()
    token.withdraw()
    await asyncio.sleep(0.001)
    assert changes(b.alive) == [("teleop", True), ("teleop", False)]
    again: VirtualBus = b.network.open_client("teleop")
    await again.connect()
