"""Measures one number of robots: all of them drive, then the operators of some of them are killed repeatedly."""

import json
import os
import random
import signal
import threading
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress

import numpy as np

from bench.rig.feed import Supervisor, supervisor
from bench.rig.load import busy_percent, machine, usage
from bench.rig.options import progress
from bench.rig.program import Program, SilentError, program, wait_until_listening
from bench.rig.sheet import percentile
from bench.robots import results

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
KILLS_LIMIT_S, MANY = 60.0, 1_000_000
DUMP_LIMIT_S = 60.0


class Layout:
    """How the operators reach their robots: here, each at the supervisor of its robot."""

    def start(self, robots: int, ending: ExitStack) -> list[Supervisor]:
        """Start the supervisors, `STARTING` at a time: more of them would delay each other beyond the time limit of a start."""
        supervisors: list[Supervisor] = []

        def terminate_all() -> None:
            """Signal all supervisors before waiting for each of them."""
            for one in supervisors:
                with suppress(ProcessLookupError):
                    os.kill(one.pid, signal.SIGTERM)

        for number in range(robots):
            supervisors.append(ending.enter_context(supervisor(options=self.options(number))))
            if number >= STARTING:
                wait_until_listening(supervisors[number - STARTING].endpoint)
        for one in supervisors[-STARTING:]:
            wait_until_listening(one.endpoint)
        ending.callback(terminate_all)
        return supervisors

    def options(self, number: int) -> list[str]:  # noqa: ARG002 - of a layout with configurations
        """Return the options of a supervisor."""
        return []

    def feeder(self, endpoints: Sequence[str]) -> list[str]:
        """Return the arguments of the feeder."""
        return list(endpoints)

    def operator(self, number: int, endpoint: str) -> str:  # noqa: ARG002 - of a layout with namespaces
        """Return how an operator reaches its robot, for bench.robots.holders."""
        return endpoint

    def router_cpu_s(self) -> float:
        """Return the processor time of the router until now."""
        return 0.0

    def crossed_bytes(self) -> int:
        """Return what the router has sent and received until now on the links that are open."""
        return 0


def measure(
    robots: int,
    seconds: float,
    kills: int | None,
    layout: Layout | None = None,
    *,
    kills_limit_s: float = KILLS_LIMIT_S,
) -> results.Crowd:
    """Measure a number of robots.

    Args:
        robots: number of robots.
        seconds: duration of the drive.
        kills: number of kills, distributed over at most `KILLED` robots; None: as many as the time permits.
        layout: how the operators reach the robots.
        kills_limit_s: maximum duration of the kills.

    Raises:
        RuntimeError: a process fails.
    """
    layout = Layout() if layout is None else layout
    with ExitStack() as ending:
        crowd = "1 robot" if robots == 1 else f"{robots} robots"
        progress(f"{crowd}: start")
        supervisors = layout.start(robots, ending)
        endpoints = [one.endpoint for one in supervisors]
        feeder = ending.enter_context(program("bench.robots.feeder", arguments=layout.feeder(endpoints)))
        with suppress(SilentError):  # with too many robots, some never drive: that is a result
            feeder.line(DRIVE_LIMIT_S)
        time.sleep(SETTLE_S)

        progress(f"{crowd}: drive")
        pids = [one.pid for one in supervisors]
        before, machine_before, feeder_before = [usage(pid) for pid in pids], machine(), usage(feeder.pid)
        router_s, crossed = layout.router_cpu_s(), layout.crossed_bytes()
        began_s = time.monotonic()
        time.sleep(seconds)
        window = began_s, time.monotonic()
        took_s = window[1] - window[0]
        router_s, crossed = layout.router_cpu_s() - router_s, layout.crossed_bytes() - crossed
        used = [usage(pid) - earlier for pid, earlier in zip(pids, before, strict=True)]
        machine_after, feeder_used = machine(), usage(feeder.pid) - feeder_before

        progress(f"{crowd}: kills for {kills_limit_s:g} s" if kills is None else f"{crowd}: {kills} kills")
        killed = min(robots, KILLED)
        feeder.tell(f"release {' '.join(map(str, range(killed)))}")
        time.sleep(STAND_S)
        kills_before = machine()
        kills_began_s = time.monotonic()
        reach = [layout.operator(number, endpoint) for number, endpoint in enumerate(endpoints[:killed])]
        kills_s = _kill(reach, kills, kills_limit_s)
        killing = kills_began_s, time.monotonic()
        kills_busy_percent = busy_percent(kills_before, machine())
        feeder.tell("end")
        while (line := feeder.line(DUMP_LIMIT_S)).startswith("driving"):
            pass  # the robots drove only after the limit
        found = json.loads(line)

    for number, robot in enumerate(found["robots"]):
        for at_s, key, payload, attachment in robot["garbled"]:
            progress(
                f"robot {number}, {at_s - window[0]:.3f} s: garbled {key}: {payload}, attachment {attachment}"
            )
    heard: list[list[results.Heard]] = [[tuple(one) for one in robot["heard"]] for robot in found["robots"]]
    late_ms = [1000.0 * late_s for due_s, late_s in found["late"] if window[0] <= due_s < window[1]]
    gaps_ms = [gap for commands in heard for gap in results.gaps_ms(window, commands)]
    decided_ms = [gap for commands in heard for gap in results.gaps_ms(window, commands, decided=True)]
    transits_ms = [transit for commands in heard for transit in results.transits_ms(window, commands)]
    causes = [results.reasons(window, robot["statuses"]) for robot in found["robots"]]
    stops_ms = [
        results.stop_ms(killed_s, commands)
        for times_s, commands in zip(kills_s, heard, strict=False)
        for killed_s in times_s
    ]
    total_s = machine_after.total_s - machine_before.total_s
    drive_busy_percent = busy_percent(machine_before, machine_after)
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
        stolen_percent=100.0 * (machine_after.stolen_s - machine_before.stolen_s) / total_s,
        other_percent=drive_busy_percent * (os.cpu_count() or 1) - own_percent,
        gap_p50_ms=percentile(gaps_ms, 50),
        gap_p99_ms=percentile(gaps_ms, 99),
        gap_max_ms=percentile(gaps_ms, 100),
        decided_gap_p99_ms=percentile(decided_ms, 99),
        transit_p99_ms=percentile(transits_ms, 99),
        late_p99_ms=percentile(late_ms, 99),
        garbled=sum(len(robot["garbled"]) for robot in found["robots"]),
        stood=sum(results.stood(window, commands) for commands in heard),
        reasons={
            name: sum(name in of for of in causes)
            for name in sorted({reason for of in causes for reason in of})
        },
        kills=sum(map(len, kills_s)) if kills is None else kills,
        stop_ms=tuple(stop for stop in stops_ms if stop is not None),
        missed=sum(stop is None for stop in stops_ms),
        kills_seconds=killing[1] - killing[0],
        stood_in_kills=sum(results.stood(killing, commands) for commands in heard[killed:]),
        router_percent=router_percent,
        crossing_bytes_s=crossed / took_s / robots,
    )


def _kill(reach: Sequence[str], kills: int | None, limit_s: float) -> list[list[float]]:
    """Repeatedly let an operator drive each robot, and kill it; return the times of the kills of each robot [s].

    Args:
        reach: how the operators reach each robot.
        kills: of all robots together; None: as many as the time permits.
        limit_s: maximum duration.
    """
    ended = threading.Event()
    with ExitStack() as ending:
        operators = [
            _Operators(ending.enter_context(program("bench.robots.holders")), number, one, ended)
            for number, one in enumerate(reach)
        ]
        pool = ending.enter_context(ThreadPoolExecutor(len(operators)))
        ending.callback(ended.set)  # after Ctrl-C, no further kill
        until_s = time.monotonic() + limit_s
        numbers = range(MANY if kills is None else kills)
        killing = [
            pool.submit(one.kill, len(numbers[number :: len(operators)]), until_s)
            for number, one in enumerate(operators)
        ]
        return [future.result() for future in killing]


class _Operators:
    """Starts and kills the operators of one robot, one after the other."""

    def __init__(self, holders: Program, number: int, reach: str, ended: threading.Event) -> None:
        self._holders = holders
        self._line = f"{number} {reach}"
        self._chance = random.Random(number)
        self._ended = ended

    def kill(self, times: int, until_s: float) -> list[float]:
        """Kill a number of operators; return the times of the kills [s], without operators that never drove."""
        killed_s: list[float] = []
        for _ in range(times):
            if time.monotonic() > until_s or self._ended.is_set():
                break
            self._holders.tell(self._line)
            pid = self._wait_for("started")
            if pid is None:
                break  # with too many robots, processes do not start in time: that is a result
            drives = self._wait_for("driving", pid) is not None
            time.sleep(self._chance.uniform(*HOLD_S))
            at_s = time.monotonic()
            os.kill(pid, signal.SIGKILL)
            if drives:
                killed_s.append(at_s)
            time.sleep(STAND_S)
        return killed_s

    def _wait_for(self, word: str, pid: int | None = None) -> int | None:
        """Wait for a line about an operator, or about the next one; return its pid, or None if none comes within the limit."""
        with suppress(SilentError):
            while True:
                found, _, whose = self._holders.line(HOLD_LIMIT_S).split()
                if found == word and pid in (None, int(whose)):
                    return int(whose)
        return None
