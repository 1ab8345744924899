"""The node over Zenoh on a session that records its declarations."""

import asyncio
import time
from collections.abc import Awaitable, Callable
from typing import cast

import pytest

from ros2 import ros
from ros2.rmw_keys import TRIGGER, TYPE_HASHES, Kind, data_key, endpoint_token, gid_of, tokens_on
from ros2.rmw_zenoh import RECENT_S, RmwZenoh
from ros2.samples import Sample, Writers
from wire import cdr
from wire.inbox import Overheard
from wire.stamp import Stamp, parse_stamp
from wire.zenoh.session import ZenohSession

DOMAIN, OTHER = 7, "ab12"
GID = bytes(range(16))
COMMAND = cdr.twist(cdr.Planar(0.5, 0.0))
JOY_KEY = f"{DOMAIN}/{data_key('/joy_vel', ros.TWIST, TYPE_HASHES[ros.TWIST])}"

IMPOSSIBLE = [
    Stamp(sequence, time_ns, GID).pack()
    for sequence, time_ns in [(-1, 1), (1, 0), (1, -(1 << 63)), (1, 1 << 62)]
]


class FakePublisher:
    def __init__(self) -> None:
        self.put: list[tuple[bytes, bytes | None]] = []

    def put_bytes(self, payload: bytes, attachment: bytes | None = None) -> None:
        self.put.append((payload, attachment))


class FakeSession:
    """The part of a ZenohSession that the node uses."""

    session_id = "cd34"

    def __init__(self) -> None:
        self.heard: dict[str, Callable[[Overheard], None]] = {}
        self.watched: dict[str, Callable[[str, bool], None]] = {}
        self.tokens: list[str] = []
        self.out: dict[str, FakePublisher] = {}
        self.served: dict[str, Callable[[bytes], Awaitable[bytes]]] = {}
        self.stamp_reply: Callable[[bytes | None], bytes | None] = lambda _: None
        self.is_closed = False

    def hear(self, expression: str, heard: Callable[[Overheard], None]) -> None:
        self.heard[expression] = heard

    def watch_tokens(self, expression: str, changed: Callable[[str, bool], None]) -> None:
        self.watched[expression] = changed

    def declare_token(self, key: str) -> None:
        self.tokens.append(key)

    def publisher_on(self, key: str) -> FakePublisher:
        return self.out.setdefault(key, FakePublisher())

    def serve_raw(
        self,
        key: str,
        handler: Callable[[bytes], Awaitable[bytes]],
        *,
        stamp_reply: Callable[[bytes | None], bytes | None],
        is_complete: bool,
    ) -> None:
        assert is_complete
        self.served[key], self.stamp_reply = handler, stamp_reply

    async def close(self) -> None:
        self.is_closed = True


class Rig:
    """A node with a source's topic and the base's topic."""

    def __init__(self) -> None:
        self.session = FakeSession()
        self.failures: list[BaseException] = []
        self.node = RmwZenoh(cast("ZenohSession", self.session), DOMAIN, self.failures.append)
        self.samples: list[Sample] = []
        self.changes = 0
        self.node.subscribe("/joy_vel", ros.TWIST, self.samples.append, self.on_match)
        self.publish = self.node.publisher("/cmd_vel", ros.TWIST, self.on_match)

    def on_match(self) -> None:
        self.changes += 1

    def put(
        self, attachment: bytes | None, *, key: str = JOY_KEY, payload: bytes = COMMAND, ago_s: float = 0.0
    ) -> None:
        """Deliver a sample that arrived some time ago."""
        arrival_s = asyncio.get_running_loop().time() - ago_s
        for heard in self.session.heard.values():
            heard(Overheard(key, payload, attachment, arrival_s))

    def token(self, kind: Kind, topic: str, *, alive: bool = True, node: str = "/joy") -> bytes:
        """Have a token appear or disappear; return the identity of its endpoint."""
        token = endpoint_token(DOMAIN, OTHER, node, 3, kind, topic, ros.TWIST, TYPE_HASHES[ros.TWIST])
        self.session.watched[tokens_on(DOMAIN, topic)](token, alive)
        return gid_of(token)


@pytest.fixture
async def rig() -> Rig:
    rig = Rig()
    assert not rig.session.heard, "nothing is received before the start"
    assert not rig.session.watched
    rig.node.start()
    return rig


async def test_a_message_has_the_stamp_of_its_attachment_and_names_its_writer(rig: Rig) -> None:
    rig.put(Stamp(5, time.time_ns() - 2_000_000_000, GID).pack())
    (sample,) = rig.samples
    assert (sample.payload, sample.sequence, sample.gid) == (COMMAND, 5, GID)
    # Its age, by the wall clock, is 2 s; its source time is by the local monotonic clock.
    assert 2.0 <= sample.arrival_s + 0.001 - sample.source_time_ns * 1e-9 < 2.5
    assert Writers(lambda: bytes(16)).gid_of(sample) == GID


@pytest.mark.parametrize(
    "attachment", [None, b"", bytes(32), bytes(33), Stamp(1, 2, GID).pack() + b"\0", *IMPOSSIBLE]
)
async def test_a_message_without_a_valid_attachment_is_refused_and_reported_for_some_time(
    rig: Rig, attachment: bytes | None
) -> None:
    assert rig.node.problem("/joy_vel") is None
    rig.put(attachment)
    assert not rig.samples
    assert "messages on /joy_vel have no attachment" in (rig.node.problem("/joy_vel") or "")
    assert rig.node.problem("/scan") is None
    rig.put(attachment, ago_s=RECENT_S + 0.01)
    assert rig.node.problem("/joy_vel") is None


async def test_a_put_on_a_wildcard_or_an_empty_sample_is_ignored(rig: Rig) -> None:
    stamp = Stamp(1, 1, GID).pack()
    rig.put(stamp, key=f"{DOMAIN}/**")
    rig.put(stamp, key=JOY_KEY.replace("joy_vel", "other"))
    rig.put(stamp, payload=b"")
    assert not rig.samples
    assert rig.node.problem("/joy_vel") is None


async def test_an_e_stop_needs_no_attachment() -> None:
    rig, pressed = Rig(), list[Sample]()
    rig.node.subscribe("/estop", ros.BOOL, pressed.append, rig.on_match)
    rig.node.start()
    rig.put(None, key=f"{DOMAIN}/{data_key('/estop', ros.BOOL, TYPE_HASHES[ros.BOOL])}", payload=cdr.TRUE)
    assert [sample.payload for sample in pressed] == [cdr.TRUE]


async def test_a_program_is_present_while_its_token_exists(rig: Rig) -> None:
    gid = rig.token(Kind.PUBLISHER, "/joy_vel")
    assert [(one.node, one.gid) for one in rig.node.publishers("/joy_vel")] == [("/joy", gid)]
    rig.token(Kind.PUBLISHER, "/joy_vel", node="/second")
    assert len(rig.node.publishers("/joy_vel")) == 2
    rig.token(Kind.PUBLISHER, "/joy_vel", alive=False)
    rig.token(Kind.PUBLISHER, "/joy_vel", alive=False)
    assert [one.node for one in rig.node.publishers("/joy_vel")] == ["/second"]
    assert rig.changes == 4
    assert rig.node.subscriptions("/cmd_vel") == []
    rig.token(Kind.SUBSCRIPTION, "/cmd_vel", node="/base")
    assert [one.node for one in rig.node.subscriptions("/cmd_vel")] == ["/base"]


async def test_the_nodes_own_endpoints_are_announced_and_listed(rig: Rig) -> None:
    assert [token.split("/")[5] for token in rig.session.tokens] == ["NN", "MS", "MP"]
    assert [one.node for one in rig.node.publishers("/cmd_vel")] == [rig.node.name]
    assert [one.node for one in rig.node.subscriptions("/joy_vel")] == [rig.node.name]


async def test_a_published_message_is_stamped_with_the_identity_of_the_announced_endpoint(rig: Rig) -> None:
    rig.publish(COMMAND)
    rig.publish(COMMAND)
    ((key, out),) = rig.session.out.items()
    assert key == data_key("/cmd_vel", ros.TWIST, TYPE_HASHES[ros.TWIST])
    stamps = [parse_stamp(attachment) for _, attachment in out.put]
    assert [stamp.sequence for stamp in stamps if stamp] == [1, 2]
    (own,) = rig.node.publishers("/cmd_vel")
    assert {stamp.gid for stamp in stamps if stamp} == {own.gid}


async def test_an_answer_carries_the_number_and_identity_of_its_request() -> None:
    rig = Rig()
    rig.node.serve("/lifeline/reset", lambda: (True, "done"))
    rig.node.start()
    handler = rig.session.served[data_key("/lifeline/reset", TRIGGER, TYPE_HASHES[TRIGGER])]
    assert cdr.trigger_reply(await handler(cdr.LITTLE_ENDIAN + b"\0")) == (True, "done")
    reply = parse_stamp(rig.session.stamp_reply(Stamp(9, 5, GID).pack()))
    assert reply is not None
    assert (reply.sequence, reply.gid) == (9, GID)
    assert rig.session.stamp_reply(None) is None


async def test_an_exception_in_a_callback_ends_the_process(rig: Rig) -> None:
    error = RuntimeError("broken")

    def fail(_: Sample) -> None:
        raise error

    rig.node.subscribe("/scan", ros.LASER_SCAN, fail, rig.on_match)
    rig.node.start()
    rig.put(Stamp(1, 1, GID).pack(), key=f"{DOMAIN}/{data_key('/scan', ros.LASER_SCAN, 'RIHS01_1')}")
    assert rig.failures == [error]


async def test_closing_closes_the_session(rig: Rig) -> None:
    await asyncio.to_thread(rig.node.close)
    assert rig.session.is_closed
