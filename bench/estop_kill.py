"""Test that a pressed e-stop survives a kill of the supervisor: `python -m bench.estop_kill --runs 300`.

It runs real processes. In each run the supervisor drives a base, the e-stop is pressed, and the supervisor is killed
(SIGKILL) at a random moment after its status showed ESTOP. The next supervisor receives neutral commands and then
motion. The run counts as latched if every status of the new supervisor contains ESTOP and every command to the base
is zero. A reset then begins the next run.
"""

import argparse
import asyncio
import os
import random
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Coroutine
from pathlib import Path

from bench.rig import scenery
from bench.rig.feed import BEAMS, ODOM_HZ, SCAN_HZ, at_rate, client, feeding, scan
from bench.rig.options import at_least_zero, count, failing_in_a_sentence
from bench.rig.options import seed as seed_number
from bench.rig.terminal import end
from deploy.stack.launch import free_loopback_endpoint
from wire import topics
from wire.bus import Arrival, wait_until
from wire.messages import Bool, SafetyStatus, odometry, planar_twist, zero_twist
from wire.zenoh.bus import ZenohBus

COMMAND_HZ = 20.0
SPEED_M_S = 0.3
KILL_WITHIN_S = 0.02
"""Latest kill after the first status that shows ESTOP; some kills precede the next tick."""
WAIT_S = 60.0
LOOK_S = 0.5
DRIVE_S = 0.3
"""How long the next supervisor receives motion commands."""
SLOW_DISK = """
import os, runpy, time
quick = os.fsync
os.fsync = lambda file: (time.sleep({fsync_s}), quick(file))
runpy.run_module("supervisor", run_name="__main__", alter_sys=True)
"""
RUNS = 300
REPORT_EVERY = 25
ESTOP = "ESTOP"
LATCHED, RELEASED, RECORDED = "latched", "RELEASED", "first status shows it recorded"


class _Supervisors:
    """Runs supervisors in sequence, with one endpoint and state directory, and an fsync slower by `fsync_s`."""

    def __init__(self, endpoint: str, folder: Path, fsync_s: float) -> None:
        self._endpoint, self._folder = endpoint, folder
        self._program = ["-c", SLOW_DISK.format(fsync_s=fsync_s)] if fsync_s else ["-m", "supervisor"]
        self._process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        with (self._folder / "supervisor.log").open("ab") as log:
            self._process = subprocess.Popen(
                [sys.executable, *self._program, "--endpoint", self._endpoint],
                stdout=log,
                stderr=log,
                env=os.environ | {"LIFELINE_STATE_DIR": str(self._folder)},
            )

    async def kill(self) -> None:
        """Kill the supervisor with SIGKILL, and wait for its end."""
        assert self._process is not None
        self._process.kill()
        await asyncio.to_thread(self._process.wait)

    def start_again_if_ended(self) -> None:
        """Restart the supervisor if it exited, as supervisord does: its port may not be free immediately."""
        if self._process is not None and self._process.poll() is not None:
            self.start()

    def last_words(self) -> str:
        """Return the end of the log."""
        return (self._folder / "supervisor.log").read_text()[-600:]

    def end(self) -> None:
        if self._process is not None:
            end(self._process)


class _Trials:
    """The operator, the lidar and the base in one client."""

    def __init__(self, bus: ZenohBus, supervisors: _Supervisors, chance: random.Random) -> None:
        self._bus, self._supervisors, self._chance = bus, supervisors, chance
        self._speed_m_s = 0.0
        self._ranges = next(iter(scenery.scans(BEAMS, 1, wall_m=scenery.ROOM_M)))
        self._commands = bus.publisher(topics.source_cmd_vel(topics.TELEOP))
        self._scans = bus.publisher(topics.SCAN)
        self._odometry = bus.publisher(topics.ODOM)
        self._button = bus.publisher(topics.ESTOP)
        self._token = bus.declare_alive(topics.TELEOP)
        self._heard = asyncio.Event()
        self._statuses = bus.subscribe(topics.STATUS, depth=1000, wake=self._heard)
        self._cmd_vel = bus.subscribe(topics.CMD_VEL, depth=10_000)
        self._former: bytes | None = None
        """The epoch of the killed supervisor's status."""
        self._epoch: bytes | None = None
        self._since_kill: list[SafetyStatus] = []
        self._moved: list[float] = []
        """Non-zero commands to the base after the kill [m/s]."""
        self.counts: Counter[str] = Counter()

    def feeds(self) -> list[Coroutine[None, None, None]]:
        return [
            at_rate(COMMAND_HZ, lambda: self._commands.put(planar_twist(self._speed_m_s, 0.0))),
            at_rate(SCAN_HZ, lambda: self._scans.put(scan(self._ranges))),
            at_rate(ODOM_HZ, lambda: self._odometry.put(odometry((0.0, 0.0, 0.0), (0.0, 0.0)))),
        ]

    async def run(self) -> bool:
        """Execute one run; return whether the e-stop stayed latched."""
        await self._drive()
        first = await self._press()
        self.counts[RECORDED] += not first.estop_record_problem
        waited_s = self._chance.uniform(0.0, KILL_WITHIN_S)
        await asyncio.sleep(waited_s)
        await self._supervisors.kill()
        self._former = self._epoch
        self._cmd_vel.take()
        self._since_kill.clear()
        self._supervisors.start()
        latched = await self._stays_latched()
        self.counts[LATCHED if latched else RELEASED] += 1
        if not latched:
            print(
                f"RELEASED: killed {1000 * waited_s:.1f} ms after a status with the record {first.estop_record_problem or 'written'}; "
                f"then {[status.reasons for status in self._since_kill]}, {self._moved}; {self._supervisors.last_words()}"
            )
        return latched

    async def _drive(self) -> None:
        """Reset the latch of the previous run, and drive."""
        self._speed_m_s = 0.0
        await self._until(lambda status: _teleop(status, neutral=True))
        reply = await self._bus.call(topics.SUPERVISOR_RESET, timeout_s=WAIT_S)
        if not reply.success:
            raise RuntimeError(f"the reset was refused: {reply.message}")
        while True:
            self._speed_m_s = 0.0
            await self._until(lambda status: status.mode == SafetyStatus.READY)
            self._speed_m_s = SPEED_M_S
            status = await self._until(lambda status: status.mode != SafetyStatus.READY)
            if status.mode == SafetyStatus.DRIVING:
                return  # and not stopped by a busy machine's late commands

    async def _press(self) -> SafetyStatus:
        """Press, and return the first status that shows it."""
        self._button.put(Bool(data=True))
        return await self._until(lambda status: ESTOP in status.reasons)

    async def _stays_latched(self) -> bool:
        """Command neutral until the new supervisor receives it and scans, then motion; return whether it stayed latched."""
        self._speed_m_s = 0.0
        await self._until(lambda status: _teleop(status, neutral=True) and status.scan_age_s < 1.0)
        self._speed_m_s = SPEED_M_S
        await self._until(lambda status: _teleop(status, neutral=False))
        await asyncio.sleep(DRIVE_S)
        await self._until(lambda _: True)
        self._moved = [
            a.message.linear.x for a in self._cmd_vel.take() if a.message and a.message != zero_twist()
        ]
        return not self._moved and all(ESTOP in status.reasons for status in self._since_kill)

    async def _until(self, condition: Callable[[SafetyStatus], bool]) -> SafetyStatus:
        """Wait for a status of the present supervisor that meets the condition, and return it."""
        last = None
        deadline_s = time.monotonic() + WAIT_S
        while time.monotonic() < deadline_s:
            self._heard.clear()
            for arrival in self._statuses.take():
                status = self._of_now(arrival)
                last = status or last
                if status is not None and condition(status):
                    return status
            self._supervisors.start_again_if_ended()
            await wait_until(self._heard, time.monotonic() + LOOK_S)
        raise RuntimeError(f"not within {WAIT_S:g} s; {last}; {self._supervisors.last_words()}")

    def _of_now(self, arrival: Arrival[SafetyStatus]) -> SafetyStatus | None:
        """Return a status of the present supervisor; None for a late status of the killed one."""
        if arrival.stamp is None or arrival.message is None or arrival.stamp.gid == self._former:
            return None
        self._epoch = arrival.stamp.gid
        self._since_kill.append(arrival.message)
        return arrival.message


def _teleop(status: SafetyStatus, *, neutral: bool) -> bool:
    """Return whether the supervisor has accepted a neutral (or non-neutral) command of the operator."""
    return any(
        s.name == topics.TELEOP and s.accepted > 0 and s.age_s < 0.2 and s.neutral is neutral
        for s in status.sources
    )


async def measure(runs: int, seed: int, fsync_s: float) -> Counter[str]:
    """Execute the runs, and count their outcomes.

    Raises:
        RuntimeError: a supervisor does not start or does not hear its operator; the message ends with its log.
    """
    endpoint = free_loopback_endpoint()
    with tempfile.TemporaryDirectory() as folder:
        supervisors = _Supervisors(endpoint, Path(folder), fsync_s)
        supervisors.start()
        try:
            async with client(endpoint) as bus:
                trials = _Trials(bus, supervisors, random.Random(seed))
                async with feeding(trials.feeds()):
                    for number in range(1, runs + 1):
                        latched = await trials.run()
                        if not latched or number % REPORT_EVERY == 0:
                            print(f"{number}: {dict(trials.counts)}", flush=True)
                    return trials.counts
        finally:
            supervisors.end()


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m bench.estop_kill",
        description="Press the e-stop, kill the supervisor, restart it, and check that the e-stop is still latched.",
        epilog="exit code: 0 if every run stayed latched, 1 if not, or if a process fails; 130 after Ctrl-C",
    )
    parser.add_argument(
        "--runs", type=count, default=RUNS, help="number of runs, about 2 s each (default: %(default)s)"
    )
    parser.add_argument(
        "--seed", type=seed_number, default=1, help="seed of the kill times (default: %(default)s)"
    )
    parser.add_argument(
        "--fsync-s",
        type=at_least_zero,
        default=0.0,
        metavar="SECONDS",
        help="simulate a busy disk: delay each fsync of the supervisor by this time (default: %(default)s)",
    )
    arguments = parser.parse_args()
    with failing_in_a_sentence("bench.estop_kill"):
        counts = asyncio.run(measure(arguments.runs, arguments.seed, arguments.fsync_s))
    print(f"{counts[LATCHED]} of {arguments.runs} runs on real processes stayed latched")
    print(f"in {counts[RECORDED]} runs the first status that showed ESTOP also showed it as recorded")
    sys.exit(counts[LATCHED] != arguments.runs)


if __name__ == "__main__":
    main()
