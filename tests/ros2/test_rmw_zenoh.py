"""The supervisor's promises through rmw_zenoh's keys: the robot and its sources use the package zenoh-ros2-sdk.

The robot has a timeout of 0.5 s of its own. The tests run in the order of this file, on one stack.
"""

import asyncio
import signal
import statistics
import time
from collections.abc import Generator
from pathlib import Path

import pytest

from ros2 import ros
from ros2.rmw_keys import TYPE_HASHES, data_key
from tests.ros2.host import Host, Line, Peer
from tests.ros2.rmw_stack import DOMAIN, RMW_PYTHON, RmwStack
from tests.ros2.stack import SOURCE, SPEED_M_S, TOPIC, send
from wire import cdr
from wire.bus_config import BusConfig
from wire.zenoh.connect import open_session
from wire.zenoh.session import ZenohSession

KILLS = 20
TIMEOUT_MS = 200.0
"""The supervisor's command timeout."""
MARGIN_MS = 80.0
"""Tolerance for a loaded machine; the measured times are printed."""
BASE_TIMEOUT_MS = 500.0

pytestmark = pytest.mark.skipif(
    not RMW_PYTHON.exists(), reason="there is no .rmw-zenoh with zenoh-ros2-sdk: run `make test-ros2`"
)


@pytest.fixture(scope="module")
def stack(tmp_path_factory: pytest.TempPathFactory) -> Generator[RmwStack]:
    """Start without a router; each test but the first leaves a complete stack."""
    folder: Path = tmp_path_factory.mktemp("rmw")
    host = Host(DOMAIN, folder)
    made: RmwStack | None = None
    try:
        made = RmwStack(host, folder)
        yield made
    finally:
        if made is not None:
            made.close()
        host.close()


@pytest.fixture
def running(stack: RmwStack) -> Generator[RmwStack]:
    assert hasattr(stack, "observer"), "the test of the start must run first"
    yield stack
    stack.end_sources()


def comes_to_rest(stack: RmwStack) -> None:
    stack.rest_after(time.monotonic_ns())


def test_without_a_router_the_process_waits_and_is_absent_for_the_supervisor(stack: RmwStack) -> None:
    log = stack.bridge.log
    stack.watch.until(
        lambda w: f"waiting for the robot's router on {stack.router_endpoint}" in log.read_text(),
        "the sentence that it waits",
    )
    stack.watch.until(lambda w: w.statuses > 3, "the supervisor's status")
    assert not stack.watch.reports
    stack.start_router_and_robot()
    stack.watch.report("scan scan", "/base on /scan")
    stack.watch.report("cmd_vel", "/base listens on /cmd_vel")


def test_sigkill_of_a_source_stops_the_robot_by_its_token(running: RmwStack) -> None:
    times_ms: list[float] = []
    for kill in range(KILLS):
        source = running.source()
        running.drive(source, SPEED_M_S if kill % 2 else -SPEED_M_S)
        if not kill:
            running.watch.report(f"source {SOURCE}", "guarded by rmw_zenoh's token")
        times_ms.append(running.zero_after(source.kill()))
        comes_to_rest(running)
    times_ms.sort()
    print(
        f"\nrmw_zenoh, SIGKILL of a source to zero on cmd_vel: n {KILLS}, p50 {statistics.median(times_ms):.1f} ms, "
        f"max {times_ms[-1]:.1f} ms"
    )
    assert times_ms[-1] < TIMEOUT_MS + MARGIN_MS
    assert statistics.median(times_ms) < 60.0


def test_a_stopped_source_stops_the_robot_and_moves_it_again_only_after_neutral(running: RmwStack) -> None:
    source = running.source()
    running.drive(source)
    assert running.zero_after(send(source, signal.SIGSTOP)) < TIMEOUT_MS + MARGIN_MS
    send(source, signal.SIGCONT)  # it goes on commanding the old velocity
    source.until(lambda line: line.get("sent") == [SPEED_M_S, 0.0], "commands", after=len(source.lines))
    running.stays_at_rest()
    running.drive(source, -SPEED_M_S)
    source.end()


def test_a_second_program_on_the_topic_stops_the_robot_and_both_are_named(running: RmwStack) -> None:
    source = running.source()
    running.drive(source)
    second = running.source("--silent", name="planner")
    both = "/planner and /source all publish on /joy_vel, so none is obeyed"
    running.watch.report(f"source {SOURCE}", both)
    comes_to_rest(running)
    running.stays_at_rest()
    second.end()
    running.drive(source, -SPEED_M_S)
    source.end()


def test_another_publisher_on_cmd_vel_is_reported(running: RmwStack) -> None:
    rogue = running.source("--silent", name="rogue", topic="/cmd_vel")
    running.watch.report("cmd_vel", "/rogue publishes on /cmd_vel too, bypassing the supervisor")
    rogue.end()
    running.watch.report("cmd_vel", "/base listens on /cmd_vel")


def test_commands_without_an_attachment_are_refused_and_reported(running: RmwStack) -> None:
    source = running.source()
    running.drive(source)
    source.tell(v=0.0)
    comes_to_rest(running)
    source.tell(v=None)
    key = f"{DOMAIN}/{data_key(TOPIC, ros.TWIST, TYPE_HASHES[ros.TWIST])}"

    async def put_unstamped() -> None:
        config = BusConfig(running.router_endpoint, str(DOMAIN))
        session = ZenohSession(await open_session(config, "client"), config.namespace)
        sentence = "messages on /joy_vel have no attachment of rmw_zenoh"
        for attachment in (None, bytes(32), bytes(33)):
            for _ in range(20):
                session.put_raw(key, cdr.twist(cdr.Planar(SPEED_M_S, 0.0)), attachment)
            await asyncio.to_thread(running.watch.report, f"source {SOURCE}", sentence)
        await session.close()

    asyncio.run(put_unstamped())
    running.stays_at_rest()
    source.end()


def test_an_e_stop_without_an_attachment_is_obeyed_and_reset_through_the_service(running: RmwStack) -> None:
    person = running.node("rmw_person")
    source = running.source()
    running.drive(source)
    key = f"{DOMAIN}/{data_key('/estop', ros.BOOL, TYPE_HASHES[ros.BOOL])}"

    async def press() -> None:
        config = BusConfig(running.router_endpoint, str(DOMAIN))
        session = ZenohSession(await open_session(config, "client"), config.namespace)
        session.put_raw(key, cdr.TRUE)
        await asyncio.to_thread(comes_to_rest, running)
        await session.close()

    asyncio.run(press())
    running.watch.report("supervisor", "ESTOP")
    source.tell(v=0.0)
    running.neutral()
    while not answer(person, "/lifeline/reset")["answer"]:  # a loaded machine may stop the robot meanwhile
        pass
    running.drive(source, -SPEED_M_S)
    arm = answer(person, "/lifeline/arm")
    assert not arm["answer"]
    assert 'no source has arm = "on_request"' in arm["message"]
    person.until(lambda line: line.get("report") == "lifeline: supervisor", "a status on /diagnostics")
    source.end()
    person.end()


def answer(person: Peer, service: str) -> Line:
    seen = len(person.lines)
    person.tell(call=service)
    return person.until(lambda line: "answer" in line, f"the answer of {service}", after=seen)


def test_the_death_of_the_router_stops_the_robot_and_its_return_moves_nothing(running: RmwStack) -> None:
    source = running.source()
    running.drive(source)
    took_ms = running.rest_after(running.router.kill())
    print(f"\nrmw_zenoh, SIGKILL of the router to standstill, by the robot's own timeout: {took_ms:.0f} ms")
    assert took_ms < BASE_TIMEOUT_MS + BASE_TIMEOUT_MS
    running.watch.report(f"source {SOURCE}", "no program publishes on /joy_vel")
    running.start_router()
    running.watch.report(f"source {SOURCE}", "guarded by rmw_zenoh's token")
    running.stays_at_rest()
    running.drive(source, -SPEED_M_S)
    source.end()


def test_sigterm_of_the_ros2_process_leaves_zero_on_cmd_vel(running: RmwStack) -> None:
    source = running.source()
    running.drive(source)
    at_ns = send(running.bridge, signal.SIGTERM)
    running.observer.until(
        lambda line: line.get("topic") == "cmd_vel" and line["at_ns"] > at_ns and line["v"] == 0.0, "zero"
    )
    running.rest_after(at_ns)
    assert running.bridge.process.wait(10.0) == 0
    running.start_bridge()
    running.drive(source, -SPEED_M_S)
    source.end()
