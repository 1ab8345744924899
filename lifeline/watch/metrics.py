"""`lifeline metrics`: serve counters and timings of one robot to Prometheus over HTTP. It publishes nothing on the bus."""

import asyncio
import math
import threading
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, NoReturn

from prometheus_client import CollectorRegistry, start_http_server
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, HistogramMetricFamily, Metric
from prometheus_client.registry import Collector

from deploy.stack.errors import DeployError
from deploy.stack.launch import Launch
from deploy.stack.listen import bracketed, cannot_listen, is_loopback, parse_listen
from deploy.stack.reach import run_command, run_connected
from lifeline.watch.metrics_account import Account, Timing
from wire import topics
from wire.bus import Bus, wait_until
from wire.stamp import parse_stamp
from wire.topics import Topic

LOOK_PERIOD_S = 0.1
DEPTH = 4096
"""Queue depth of each topic: no arrival is missed while the loop is busy."""
TIMED: tuple[Topic[Any], ...] = (topics.STATUS, topics.SCAN, topics.ODOM, topics.CMD_VEL)


@dataclass(eq=False)  # the registry uses it as a key
class Ledger(Collector):
    """The account and the timing of a robot, shared by the event loop and the threads of the HTTP server."""

    account: Account = field(default_factory=Account)
    timings: Mapping[str, Timing] = field(
        default_factory=lambda: {_label(topic): Timing() for topic in TIMED}
    )
    lock: threading.Lock = field(default_factory=threading.Lock)

    def collect(self) -> Iterator[Metric]:
        """Yield the metrics of this moment; called by the HTTP server for each request."""
        with self.lock:
            families = list(metrics_at(self.account, self.timings, time.monotonic()))
        yield from families


def _label(topic: Topic[Any]) -> str:
    """Return the last part of the key: status, scan, odom or cmd_vel."""
    return topic.key.rpartition("/")[2]


def metrics_at(account: Account, timings: Mapping[str, Timing], now_s: float) -> Iterator[Metric]:
    """Yield the metrics of an account at `now_s`, by the monotonic clock."""
    account.advance(now_s)
    yield from _counters(account)
    yield from _gauges(account, now_s)
    ages = HistogramMetricFamily(
        "lifeline_message_age_seconds",
        "Age at arrival, in excess of the smallest one in the sender's run.",
        labels=["topic"],
    )
    gaps = HistogramMetricFamily(
        "lifeline_message_gap_seconds", "Time between two arrivals.", labels=["topic"]
    )
    for name, timing in timings.items():
        ages.add_metric([name], timing.ages.cumulative(), timing.ages.sum)
        gaps.add_metric([name], timing.gaps.cumulative(), timing.gaps.sum)
    yield ages
    yield gaps


def _counters(account: Account) -> Iterator[Metric]:
    stops = CounterMetricFamily(
        "lifeline_stops", "Number of times that a stop reason appeared.", labels=["reason"]
    )
    for reason, count in sorted(account.stops.items()):
        stops.add_metric([reason], count)
    modes = CounterMetricFamily("lifeline_mode_seconds", "Time in each mode.", labels=["mode"])
    for mode, duration_s in account.mode_s.items():
        modes.add_metric([mode], duration_s)
    accepted = CounterMetricFamily(
        "lifeline_commands_accepted", "Commands that the supervisor accepted.", labels=["source"]
    )
    for key, count in account.accepted.totals.items():
        accepted.add_metric(key, count)
    refused = CounterMetricFamily(
        "lifeline_commands_refused", "Commands that the supervisor refused.", labels=["source", "kind"]
    )
    for key, count in account.refused.totals.items():
        refused.add_metric(key, count)
    yield from (stops, modes, accepted, refused)


def _gauges(account: Account, now_s: float) -> Iterator[Metric]:
    """Yield the present values; a value that is unknown or outdated is left out."""
    status, twist = account.status_at(now_s), account.twist_at(now_s)
    yield GaugeMetricFamily(
        "lifeline_up",
        "1 if a status of the supervisor arrived in the last second.",
        float(status is not None),
    )
    if twist is not None:
        yield GaugeMetricFamily(
            "lifeline_linear_velocity_meters_per_second",
            "Forward velocity by odometry; negative: backward.",
            twist.linear.x,
        )
        yield GaugeMetricFamily(
            "lifeline_angular_velocity_radians_per_second",
            "Turn rate by odometry, counter-clockwise.",
            twist.angular.z,
        )
    if status is None:
        return
    if math.isfinite(status.nearest_m):
        yield GaugeMetricFamily(
            "lifeline_nearest_meters", "Distance from the hull to the nearest point.", status.nearest_m
        )
    yield GaugeMetricFamily(
        "lifeline_alarm", "1 if the base moves although zero is commanded.", float(status.alarm)
    )


def serve(ledger: Ledger, listen: str) -> str:
    """Start the HTTP server on daemon threads and return the address at which it serves.

    Raises:
        DeployError: the address is invalid, in use, or not one of this machine.
    """
    host, port = parse_listen(listen)
    registry = CollectorRegistry()
    registry.register(ledger)
    try:
        server, _ = start_http_server(port, host, registry)
    except UnicodeError as error:
        raise DeployError(f"--listen {listen!r} is not an address: {error}") from error
    except OSError as error:
        raise cannot_listen(listen, error.errno, error.strerror or str(error)) from error
    return f"http://{bracketed(host)}:{server.server_port}/metrics"


def metrics(launch: Launch, listen: str) -> NoReturn:
    """Serve the metrics until Ctrl-C.

    Raises:
        DeployError: the server cannot listen.
    """
    ledger = Ledger()
    address = serve(ledger, listen)
    print(f"lifeline: serving {address}; press Ctrl-C to end", flush=True)
    if not is_loopback(parse_listen(listen)[0]):
        print("lifeline: other machines can read the metrics, without a password", flush=True)

    async def main(stop: asyncio.Event) -> int:
        await run_connected(launch.bus, stop, lambda bus: _count(bus, ledger, stop))
        return 0

    run_command(main)


async def _count(bus: Bus, ledger: Ledger, stop: asyncio.Event) -> None:
    statuses = bus.subscribe(topics.STATUS, depth=DEPTH)
    odometry = bus.subscribe(topics.ODOM, depth=DEPTH)
    undecoded = (
        (_label(topics.SCAN), bus.subscribe(topics.SCAN, depth=DEPTH)),
        (_label(topics.CMD_VEL), bus.subscribe(topics.CMD_VEL, depth=DEPTH)),
    )
    while not stop.is_set():
        with ledger.lock:
            for status in statuses.take():
                ledger.timings[_label(topics.STATUS)].arrive(status.arrival_s, status.stamp)
                if status.message is not None:
                    ledger.account.hear_status(status.message, status.arrival_s, status.stamp)
            for odom in odometry.take():
                ledger.timings[_label(topics.ODOM)].arrive(odom.arrival_s, odom.stamp)
                if odom.message is not None:
                    ledger.account.hear_odometry(odom.message.twist.twist, odom.arrival_s)
            for name, subscription in undecoded:
                for arrival in subscription.take_raw():
                    ledger.timings[name].arrive(arrival.arrival_s, parse_stamp(arrival.attachment))
        await wait_until(stop, time.monotonic() + LOOK_PERIOD_S)
