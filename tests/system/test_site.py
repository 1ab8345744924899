"""A site with real certificates in network namespaces: an operator and two robots around a router. `pytest -s` prints the times."""

import os
import queue
import signal
import statistics
import subprocess
import sys
import time
from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from bench.link.namespaces import why_not
from bench.rig.program import ROOT, Program, program
from deploy.keys.commands import init, issue
from deploy.keys.register import Request
from tests.system.routers import end, start_router
from tests.system.star import Star, star
from wire.roles import ANY, Role

reason = why_not()
pytestmark = [
    pytest.mark.timed,
    pytest.mark.timeout(180),
    pytest.mark.skipif(reason is not None, reason=str(reason)),
]

ROBOTS = ("robot1", "robot2")
OPERATOR = "operator"
PORT, HUB_PORT = 7448, 7447
WITHIN_S = 30.0
MONTH_S = 30 * 86400.0
KILLS = 15
KILL_P50_MS = 60.0
"""Two hops on a loaded machine; the goal is 10 ms on a quiet one, and the test prints what it measures."""
TIMEOUT_S, TICK_S, MACHINE_S = 0.2, 0.02, 0.3
WATCH_S = 1.0


@dataclass
class Site:
    net: Star
    keys: dict[str, Path]
    ending: ExitStack
    robots: dict[str, Program] = field(default_factory=dict[str, Program])
    router: "subprocess.Popen[str] | None" = None

    def endpoint(self, node: str) -> str:
        """Return the endpoint of the router for a node."""
        return f"tls/{self.net.centre_seen_by(node)}:{PORT}"

    def start_router(self) -> None:
        self.router = start_router(
            f"tls/0.0.0.0:{PORT}", ROBOTS, self.keys["router"], prefix=self.net.inside("centre")
        )

    def kill_router(self) -> float:
        assert self.router is not None
        killed_s = time.monotonic()
        end(self.router)
        return killed_s

    def next(self, robot: str, word: str, since_s: float = 0.0, within_s: float = WITHIN_S) -> float:
        """Return when a robot next began to move, or came to zero, after a time."""
        deadline_s = time.monotonic() + within_s
        while True:
            what, at_s = self.robots[robot].line(max(deadline_s - time.monotonic(), 0.001)).split()
            if what == word and float(at_s) >= since_s:
                return float(at_s)

    def changes(self, robot: str) -> list[str]:
        """Return the changes that a robot has reported and nobody has read."""
        found: list[str] = []
        while True:
            try:
                found.append(self.robots[robot].lines.get_nowait())
            except queue.Empty:
                return found


class Operators:
    """Starts processes that drive robots, from one namespace; they run until they are killed."""

    def __init__(self, site: Site, node: str) -> None:
        self._site, self._node = site, node
        self._holders = site.ending.enter_context(program("bench.robots.holders", site.net.inside(node)))

    def drive(self, robot: str, *, is_local: bool = False) -> int:
        """Start an operator, wait until its robot moves, and return its pid."""
        endpoint = f"tcp/127.0.0.1:{HUB_PORT}" if is_local else self._site.endpoint(self._node)
        self._site.changes(robot)
        self._holders.tell(f"{robot} {endpoint} {robot} {self._site.keys[OPERATOR]}")
        while not (line := self._holders.line(WITHIN_S)).startswith("driving"):
            pass
        self._site.next(robot, "moves")
        return int(line.split()[2])

    def replace(self, pid: int, robot: str) -> int:
        """Replace an operator by a new one, who sends a neutral command first."""
        os.kill(pid, signal.SIGKILL)
        return self.drive(robot)


@contextmanager
def site(directory: Path) -> Generator[Site]:
    with ExitStack() as ending:
        net = ending.enter_context(star(OPERATOR, *ROBOTS))
        hosts = tuple(net.centre_seen_by(node) for node in net.nodes)
        made = Site(net, _issue(directory, hosts), ending)
        made.start_router()
        ending.callback(lambda: made.router and end(made.router))
        for robot in ROBOTS:
            _start_robot(made, robot, directory)
        yield made


def _issue(directory: Path, hosts: tuple[str, ...]) -> dict[str, Path]:
    folder = directory / "keys"
    init(folder, replace=False)
    wanted = [Request("router", Role.ROUTER, ANY, hosts), Request(OPERATOR, Role.OPERATOR, ANY, None)]
    wanted += [Request(robot, Role.SUPERVISOR, robot, None) for robot in ROBOTS]
    return {one.name: Path(issue(folder, one, MONTH_S)["bundle"]) for one in wanted}


def _start_robot(made: Site, robot: str, directory: Path) -> None:
    config, log = directory / f"{robot}.toml", directory / f"{robot}.log"
    config.write_text(
        f'[bus]\nnamespace = "{robot}"\nkeys = "{made.keys[robot]}"\nrouters = ["{made.endpoint(robot)}"]\n'
    )
    with log.open("wb") as output:
        supervisor = subprocess.Popen(
            [*made.net.inside(robot), sys.executable, "-m", "supervisor", "--config", str(config)],
            cwd=ROOT,
            stdout=output,
            stderr=output,
            env=os.environ | {"LIFELINE_STATE_DIR": str(directory / f"state-{robot}")},
        )
    made.ending.callback(lambda: (supervisor.terminate(), supervisor.wait(WITHIN_S)))
    made.robots[robot] = made.ending.enter_context(
        program("tests.system.light_robot", made.net.inside(robot), [f"tcp/127.0.0.1:{HUB_PORT}", robot])
    )


def stopped_by_age(site: Site, robot: str, cut_s: float) -> float:
    """Return how long after a cut the robot was commanded to stop, at most the command timeout."""
    took_s = site.next(robot, "zero", cut_s) - cut_s
    assert took_s <= TIMEOUT_S + TICK_S + MACHINE_S, f"{robot}: zero only {took_s:.3f} s after the cut"
    return took_s


def stay_as_they_are(site: Site) -> None:
    """Check for `WATCH_S` that no robot begins to move or stops; the time is what is measured."""
    time.sleep(WATCH_S)
    assert [site.changes(robot) for robot in ROBOTS] == [[], []]


def test_exactly_the_robots_whose_operators_are_lost_stop_and_drive_again(tmp_path: Path) -> None:
    """Kills of an operator two hops away, cuts of links, and the death of the router, in one site."""
    with site(tmp_path) as made:
        remote = Operators(made, OPERATOR)
        stops_ms: list[float] = []
        for _ in range(KILLS):
            pid, killed_s = remote.drive("robot1"), time.monotonic()
            os.kill(pid, signal.SIGKILL)
            stops_ms.append((made.next("robot1", "zero", killed_s) - killed_s) * 1e3)
        p50_ms = statistics.median(stops_ms)
        print(
            f"\n    measured: SIGKILL of an operator two hops away to zero at the robot, n = {KILLS}: "
            f"p50 {p50_ms:.1f} ms, max {max(stops_ms):.1f} ms"
        )
        assert p50_ms <= KILL_P50_MS

        local = Operators(made, "robot2")
        local.drive("robot2", is_local=True)
        pid = remote.drive("robot1")

        made.net.cut(OPERATOR)
        took_s = stopped_by_age(made, "robot1", time.monotonic())
        print(f"    measured: cut of the operator's link to zero {took_s * 1e3:.0f} ms")
        made.net.mend(OPERATOR)
        stay_as_they_are(
            made
        )  # it has the same operator again, who asks for motion without a neutral command
        pid = remote.replace(pid, "robot1")

        made.net.cut("robot1")
        took_s = stopped_by_age(made, "robot1", time.monotonic())
        print(f"    measured: cut of the robot's link to zero {took_s * 1e3:.0f} ms")
        made.net.mend("robot1")
        stay_as_they_are(made)
        pid = remote.replace(pid, "robot1")

        killed_s = made.kill_router()
        took_s = made.next("robot1", "zero", killed_s) - killed_s
        print(f"    measured: SIGKILL of the router to zero at the robot {took_s * 1e3:.1f} ms")
        assert took_s <= TIMEOUT_S + TICK_S + MACHINE_S
        made.start_router()
        stay_as_they_are(made)
        began_s = time.monotonic()
        remote.replace(pid, "robot1")
        print(
            f"    measured: driven again {time.monotonic() - began_s:.1f} s after the start of a new operator"
        )
        assert made.changes("robot2") == []
