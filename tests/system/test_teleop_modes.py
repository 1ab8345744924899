"""`python -m teleop --mode hold`, `--view-only` and the dashboard, on terminals with different abilities."""

import asyncio

import pytest

from tests.system.operators import (
    LIMIT_S,
    ZERO,
    Hub,
    driving,
    free_endpoint,
    hold_down,
    hub,
    operator,
    press,
    ready,
    until,
)
from wire import topics
from wire.messages import SafetyStatus, odometry
from wire.zenoh.bus import BusConfig, open_bus

pytestmark = pytest.mark.smoke

ALL_FLAGS = 31
DISAMBIGUATE_ALONE = 1
HEARTBEATS_OF_A_TAP = 8
"""In their time, 0.4 s, a tap that moved the robot would have done so."""


def is_moving(h: Hub) -> bool:
    return h.velocities[-1:] not in ([], [ZERO])


async def test_holding_where_the_terminal_reports_releases() -> None:
    endpoint = free_endpoint()
    async with hub(endpoint) as h, operator(endpoint, "--mode", "hold", kitty=ALL_FLAGS) as op:
        await ready(h, op)
        await until(lambda: "releases reported" in op.picture)
        assert op.kitty_flags == [15]
        assert "1004" in op.modes_on

        await press(lambda: op.hold("i"), lambda: h.asks(0.5, 0.0))
        op.key("l", 1)
        await until(lambda: h.asks(0.5, -1.0))
        op.key("i", 3)
        await until(lambda: h.asks(0.0, -1.0))
        op.key("l", 3)
        await until(lambda: h.asks(*ZERO))

        op.type(b"\x1b[1;1:1A")  # the arrow
        await until(lambda: is_moving(h))
        op.type(b"\x1b[1;1:3A")
        await until(lambda: h.asks(*ZERO))

        op.key("i", 1)
        await until(lambda: is_moving(h))
        op.type(b"\x1b[O")  # the focus is lost, and every release with it
        await until(lambda: h.asks(*ZERO))
        op.key("i", 2)
        op.type(b"\x1b[I")
        op.key("i", 3)

        op.type(b"iii")  # pasted: no release follows
        op.key("q", 1)
        await until(lambda: "0.55 m/s, 1.10 rad/s" in op.picture)
        assert h.asks(*ZERO)

        op.key("i", 1)
        await until(lambda: is_moving(h))
        op.key(" ", 1)
        await until(lambda: h.got_estop() and h.asks(*ZERO))
        op.key("c", 1, modifiers=5)
        assert await op.ended() == (0, "")
        await until(lambda: h.is_left() and op.is_restored)


async def test_holding_where_the_terminal_reports_no_releases() -> None:
    endpoint = free_endpoint()
    async with hub(endpoint) as h, operator(endpoint, "--mode", "hold") as op:
        await ready(h, op)
        await until(lambda: "by key repeat" in op.picture)
        assert not op.kitty_flags
        before = len(h.velocities)
        await press(lambda: op.type(b"i"), lambda: "a tap is too short to move" in op.picture)
        await until(lambda: len(h.velocities) >= before + HEARTBEATS_OF_A_TAP)
        assert set(h.velocities) == {ZERO}
        seen = len(h.velocities)
        await hold_down(op, b"i", lambda: h.asks(0.5, 0.0))
        await until(lambda: h.asks(*ZERO))
        moved = [velocity for velocity in h.velocities[seen:] if velocity != ZERO]
        assert max(linear for linear, _ in moved) == 0.5
        op.type(b" ")
        await until(h.got_estop)
        op.type(b"\x03")
        assert await op.ended() == (0, "")
        await until(lambda: h.is_left() and op.is_restored)


async def test_a_terminal_that_speaks_the_protocol_without_releases_counts_as_one_without() -> None:
    endpoint = free_endpoint()
    async with hub(endpoint) as h, operator(endpoint, "--mode", "hold", kitty=DISAMBIGUATE_ALONE) as op:
        await ready(h, op)
        await until(lambda: op.kitty_flags == [DISAMBIGUATE_ALONE] and "by key repeat" in op.picture)
        op.key("c", 1, modifiers=5)
        assert await op.ended() == (0, "")
        await until(lambda: op.is_restored)


async def test_an_answer_that_comes_late_is_still_an_answer() -> None:
    endpoint = free_endpoint()
    async with hub(endpoint) as h, operator(endpoint, "--mode", "hold") as op:
        await ready(h, op)
        await until(lambda: "by key repeat" in op.picture)
        op.kitty = ALL_FLAGS
        op.type(b"\x1b[?0u")
        await until(lambda: "releases reported" in op.picture)
        await press(lambda: op.hold("i"), lambda: is_moving(h))
        op.key("k", 1)
        await until(lambda: h.asks(*ZERO))


async def test_the_dashboard_shows_what_it_hears_resizes_and_rings() -> None:
    async with driving() as (h, op):
        async with asyncio.timeout(LIMIT_S):
            robot = await open_bus(BusConfig(op.endpoint), "client")
        try:
            odom = robot.publisher(topics.ODOM)

            def is_shown() -> bool:
                """Publish repeatedly: after half a second the dashboard shows a value as old."""
                h.tell(
                    SafetyStatus.DRIVING,
                    nearest_m=0.44,
                    nearest_bearing_rad=0.0,
                    warning=True,
                    owner="teleop",
                )
                odom.put(odometry((1.25, -0.5, 0.0), (0.1, 0.0)))
                return all(word in op.picture for word in ("DRIVING", "0.44", "+1.25"))

            await until(is_shown)
            assert op.bells == 1
            op.type(b"3")
            await until(lambda: "3 of 5" in op.picture)
            op.resize(80, 24)
            await until(
                lambda: h.tell(SafetyStatus.STOPPED, "OBSTACLE") or "STOPPED" in op.picture.splitlines()[0]
            )
            assert max(len(line.rstrip()) for line in op.picture.splitlines()) <= 80
        finally:
            await robot.close()


async def test_who_looks_on_commands_nothing_but_the_emergency_stop() -> None:
    async with driving() as (h, op):
        seen = len(h.velocities)
        async with operator(op.endpoint, "--view-only") as viewer:
            await until(lambda: "view only" in viewer.picture)
            viewer.type(b"wwxs")
            await until(lambda: h.tell(SafetyStatus.READY) or "READY" in viewer.picture)
            viewer.type(b" ")
            await until(h.got_estop)
            assert set(h.velocities[seen:]) == {(0.1, 0.0)}
            viewer.type(b"q")
            assert await viewer.ended() == (0, "")
            await until(lambda: viewer.is_restored)
        await until(h.sees_teleop)
        assert op.process.poll() is None
