"""Measures one number of robots: all of them drive, then the operators of some of them are killed repeatedly."""

import itertools
import json
import os
import random
import signal
import time
from collections import Counter
from collections.abc import Sequence
from contextlib import ExitStack, suppress

import numpy as np

from bench.rig.feed import Plan
from bench.rig.load import busy_percent, machine, usage
from bench.rig.nodes import Supervisor, supervisor
from bench.rig.options import progress
from bench.rig.program import Program, SilentError, program, wait_until_listening
from bench.rig.sheet import percentile
from bench.robots import results
from bench.robots.site import Site
from wire.bus_config import BusConfig

STARTING = 2
"""Number of supervisors that start at the same time."""
DRIVE_LIMIT_S, SETTLE_S = 30.0, 3.0
KILLED = 2
"""Number of robots whose operators are killed; the others drive."""
HOLD_S = (0.2, 0.4)
"""Range of the random time that an operator drives before its kill, so that kills have no fixed phase in a tick."""
HOLD_LIMIT_S = 5.0
STAND_S = 0.3
"""Time from a kill to the start of the next operator."""
KILLS_LIMIT_S, DUMP_LIMIT_S = 60.0, 60.0
DEFAULT = BusConfig().namespace


def _start(robots: int, site: Site | None, ending: ExitStack) -> list[Supervisor]:
    """Start the supervisors, `STARTING` at a time: more of them would delay each other beyond the time limit of a start."""
    supervisors: list[Supervisor] = []

    def terminate_all() -> None:
        """Signal all supervisors before waiting for each of them."""
        for one in supervisors:
            with suppress(ProcessLookupError):
                os.kill(one.pid, signal.SIGTERM)

    for number in range(robots):
        options = [] if site is None else ["--config", str(site.configs[number])]
        supervisors.append(ending.enter_context(supervisor(options=options)))
        if number >= STARTING:
            wait_until_listening(supervisors[number - STARTING].endpoint)
    for one in supervisors[-STARTING:]:
        wait_until_listening(one.endpoint)
    ending.callback(terminate_all)
    return supervisors


def measure(
    robots: int,
    seconds: float,
    kills: int | None,
    site: Site | None = None,
    *,
    kills_limit_s: float = KILLS_LIMIT_S,
) -> results.Crowd:
    """Measure a number of robots.

    Args:
        robots: number of robots.
        seconds: duration of the drive.
        kills: number of kills, distributed over at most `KILLED` robots; None: as many as the time permits.
        site: None: each operator connects to the supervisor of its robot.
        kills_limit_s: maximum duration of the kills.

    Raises:
        RuntimeError: a process fails.
    """
    with ExitStack() as ending:
        crowd = "1 robot" if robots == 1 else f"{robots} robots"
        progress(f"{crowd}: start")
        supervisors = _start(robots, site, ending)
        endpoints = [one.endpoint for one in supervisors]
        namespaces = [DEFAULT] * robots if site is None else site.namespaces
        own = list(zip(endpoints, namespaces, strict=True))
        behind = None if site is None else [(site.endpoint, name, str(site.operator)) for name in namespaces]
        plan = Plan(own, behind or [None] * robots)
        feeder = ending.enter_context(program("bench.rig.feed", arguments=plan.words()))
        with suppress(SilentError):  # with too many robots, some never drive: that is a result
            feeder.line(DRIVE_LIMIT_S)
        time.sleep(SETTLE_S)

        progress(f"{crowd}: drive")
        pids = [one.pid for one in supervisors]
        before, machine_before, feeder_before = [usage(pid) for pid in pids], machine(), usage(feeder.pid)
        router_before = (0.0, 0) if site is None else site.use()
        began_s = time.monotonic()
        time.sleep(seconds)
        window = began_s, time.monotonic()
        took_s = window[1] - window[0]
        router_after = (0.0, 0) if site is None else site.use()
        used = [usage(pid) - earlier for pid, earlier in zip(pids, before, strict=True)]
        machine_after, feeder_used = machine(), usage(feeder.pid) - feeder_before

        progress(f"{crowd}: kills for {kills_limit_s:g} s" if kills is None else f"{crowd}: {kills} kills")
        killed = min(robots, KILLED)
        feeder.tell(f"release {' '.join(map(str, range(killed)))}")
        time.sleep(STAND_S)
        kills_before = machine()
        kills_began_s = time.monotonic()
        kills_s = _kill([" ".join(way) for way in (behind or own)[:killed]], kills, kills_limit_s)
        killing = kills_began_s, time.monotonic()
        kills_busy_percent = busy_percent(kills_before, machine())
        feeder.tell("end")
        while (line := feeder.line(DUMP_LIMIT_S)).startswith("driving"):
            pass  # the robots drove only after the limit
        found = json.loads(line)

    heard: list[list[results.Heard]] = [[tuple(one) for one in robot["heard"]] for robot in found["robots"]]
    late_ms = [1000.0 * late_s for due_s, late_s in found["late"] if window[0] <= due_s < window[1]]
    gaps_ms = [gap for commands in heard for gap in results.gaps_ms(window, commands)]
    transits_ms = [transit for commands in heard for transit in results.transits_ms(window, commands)]
    reasons = Counter(one for robot in found["robots"] for one in results.reasons(window, robot["statuses"]))
    stops_ms = [
        results.stop_ms(killed_s, commands)
        for times_s, commands in zip(kills_s, heard, strict=False)
        for killed_s in times_s
    ]
    drive_busy_percent = busy_percent(machine_before, machine_after)
    router_s, crossed = np.subtract(router_after, router_before)
    router_percent = 100.0 * router_s / took_s
    own_percent = sum(one.cpu_percent for one in used) + feeder_used.cpu_percent + router_percent
    return results.Crowd(
        robots=robots,
        seconds=took_s,
        cpu_percent=tuple(one.cpu_percent for one in used),
        delay_percent=float(np.mean([100.0 * one.delay_s / one.at_s for one in used])),
        feeder_percent=feeder_used.cpu_percent,
        busy_percent=drive_busy_percent,
        kills_busy_percent=kills_busy_percent,
        other_percent=drive_busy_percent * (os.cpu_count() or 1) - own_percent,
        gap_p50_ms=percentile(gaps_ms, 50),
        gap_p99_ms=percentile(gaps_ms, 99),
        gap_max_ms=percentile(gaps_ms, 100),
        transit_p99_ms=percentile(transits_ms, 99),
        late_p99_ms=percentile(late_ms, 99),
        garbled=sum(robot["garbled"] for robot in found["robots"]),
        stood=sum(results.stood(window, commands) for commands in heard),
        reasons=dict(sorted(reasons.items())),
        kills=sum(map(len, kills_s)) if kills is None else kills,
        stop_ms=tuple(stop for stop in stops_ms if stop is not None),
        missed=sum(stop is None for stop in stops_ms),
        kills_seconds=killing[1] - killing[0],
        stood_in_kills=sum(results.stood(killing, commands) for commands in heard[killed:]),
        router_percent=router_percent,
        crossing_bytes_s=crossed / took_s / robots,
    )


def _kill(ways: Sequence[str], kills: int | None, limit_s: float) -> list[list[float]]:
    """For one robot after the other, repeatedly start an operator, let it drive, and kill it; return the times of the kills of each robot [s].

    Operators that never drove do not count.

    Args:
        ways: how an operator reaches each robot, for bench.robots.holders.
        kills: of all robots together; None: as many as the time permits.
        limit_s: maximum duration.
    """
    chance, killed_s = random.Random(0), [list[float]() for _ in ways]
    until_s = time.monotonic() + limit_s
    with program("bench.robots.holders") as holders:
        for number in itertools.count() if kills is None else range(kills):
            if time.monotonic() > until_s:
                break
            robot = number % len(ways)
            holders.tell(f"{robot} {ways[robot]}")
            pid = _pid_of(holders, "started")
            if pid is None:
                break  # with too many robots, processes do not start in time: that is a result
            drives = _pid_of(holders, "driving", pid) is not None
            time.sleep(chance.uniform(*HOLD_S))
            at_s = time.monotonic()
            os.kill(pid, signal.SIGKILL)
            if drives:
                killed_s[robot].append(at_s)
            time.sleep(STAND_S)
    return killed_s


def _pid_of(holders: Program, word: str, pid: int | None = None) -> int | None:
    """Wait for a line about an operator, or about the next one; return its pid, or None if none comes within the limit."""
    with suppress(SilentError):
        while True:
            found, _, whose = holders.line(HOLD_LIMIT_S).split()
            if found == word and pid in (None, int(whose)):
                return int(whose)
    return None
