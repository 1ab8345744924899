"""Measure the cost of the black box: `python -m bench.black_box`.

It reports the cost of a step, the memory, the size of a file, and the lateness of ticks while a file is written.
"""

import argparse
import asyncio
import tempfile
import threading
import time
import tracemalloc
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from bench.rig.options import failing_in_a_sentence
from supervisor.blackbox import file as blackbox_file
from supervisor.blackbox import recorder as blackbox
from supervisor.blackbox.file import Order
from supervisor.blackbox.recorder import BlackBox
from supervisor.config import SupervisorSection
from supervisor.law.model import Command, Decision, Inputs, LaserScan, Odometry, State, Velocity
from supervisor.law.safety import initial_state, step
from wire.freshness import Sent

BEAMS = 360
STEP_HZ, SCAN_HZ, ODOM_HZ, COMMAND_HZ = 150, 20, 50, 20
MEASURED_S = 30.0
PAUSE_S = 0.2

Step = tuple[float, Inputs, State, Decision]


def inputs(seconds: float) -> Iterator[tuple[float, Inputs]]:
    """Yield the inputs of a drive with a noisy lidar, which compress worse than those of a simulator."""
    rng = np.random.default_rng(1)
    linear_m_s = 0.0
    for i in range(round(seconds * STEP_HZ)):
        now_s = 1000.0 + i / STEP_HZ
        scan = odometry = None
        commands: tuple[Command, ...] = ()
        if i * SCAN_HZ // STEP_HZ != (i - 1) * SCAN_HZ // STEP_HZ:
            ranges = (3.0 + rng.normal(0.0, 0.01, BEAMS)).astype(np.float32)
            scan = LaserScan(ranges, -np.pi, 2 * np.pi / BEAMS, 0.1, 12.0, now_s)
        if i * ODOM_HZ // STEP_HZ != (i - 1) * ODOM_HZ // STEP_HZ:
            odometry = Odometry(Velocity(linear_m_s + rng.normal(0.0, 0.001), rng.normal(0.0, 0.001)), now_s)
        if i * COMMAND_HZ // STEP_HZ != (i - 1) * COMMAND_HZ // STEP_HZ:
            linear_m_s = 0.5 if i / STEP_HZ % 5 > 1 else 0.0
            sent = Sent(b"e" * 16, i, now_s - 0.001)
            commands = (Command("teleop", Velocity(linear_m_s, 0.0), now_s, sent),)
        yield now_s, Inputs(commands=commands, scans=() if scan is None else (scan,), odometry=odometry)


def steps(seconds: float) -> list[Step]:
    state = initial_state(SupervisorSection().law())
    taken: list[Step] = []
    for now_s, received in inputs(seconds):
        before = state
        state, decision = step(state, now_s, received)
        taken.append((now_s, received, before, decision))
    return taken


class Kept:
    """A writer that keeps its order and writes nothing."""

    order: Order | None = None

    def submit(self, order: Order) -> None:
        self.order = order

    def close(self) -> None:
        pass


def record(taken: list[Step]) -> Order:
    """Print the time and memory cost of a step; return the order of a stop's recording."""
    kept = Kept()
    law = SupervisorSection().law()
    box = BlackBox(law, kept, window_s=60.0)
    costs_us = np.empty(len(taken))
    for i, one in enumerate(taken):
        started_s = time.perf_counter()
        box.record(*one)
        costs_us[i] = (time.perf_counter() - started_s) * 1e6
    p50, p99 = np.percentile(costs_us, [50, 99])
    print(
        f"record(): mean {costs_us.mean():.1f} µs, p50 {p50:.1f}, p99 {p99:.1f}, max {costs_us.max():.0f}; "
        f"{costs_us.mean() * STEP_HZ * 1e-4:.2f} % of a core at {STEP_HZ} steps/s"
    )
    tracemalloc.start()
    box = BlackBox(law, kept, window_s=60.0)
    for one in taken:
        box.record(*one)
    print(f"memory for 60 s: {tracemalloc.get_traced_memory()[0] / 1e6:.1f} MB")
    tracemalloc.stop()
    now_s, _, before, _ = taken[-1]
    pressed = Inputs(estop=True)
    box.record(now_s + 0.01, pressed, before, step(before, now_s + 0.01, pressed)[1])
    box.close()
    assert kept.order is not None
    return kept.order


async def lateness(act: Callable[[], object]) -> str:
    """Measure the lateness of 150 ticks/s, each with a step, while `act` runs repeatedly on a thread."""
    loop = asyncio.get_running_loop()
    stop, writing = threading.Event(), threading.Event()

    def repeat() -> None:
        while not stop.wait(PAUSE_S):
            writing.set()
            act()
            writing.clear()

    thread = threading.Thread(target=repeat, daemon=True)
    thread.start()
    state = initial_state(SupervisorSection().law())
    late_ms: list[float] = []
    due_s = loop.time()
    for _, received in inputs(MEASURED_S):
        due_s += 1.0 / STEP_HZ
        await asyncio.sleep(due_s - loop.time())
        if writing.is_set():
            late_ms.append((loop.time() - due_s) * 1e3)
        state, _ = step(state, due_s, received)
    stop.set()
    await asyncio.to_thread(thread.join)
    p50, p99, p999 = np.percentile(late_ms, [50, 99, 99.9])
    return (
        f"{len(late_ms):,} ticks, p50 {p50:.2f} ms, p99 {p99:.2f}, p99.9 {p999:.2f}, max {max(late_ms):.2f}"
    )


def main() -> None:
    argparse.ArgumentParser(prog="python -m bench.black_box", description=__doc__).parse_args()
    with failing_in_a_sentence("bench.black_box"):
        _measure()


def _measure() -> None:
    order = record(steps(75.0))
    with tempfile.TemporaryDirectory() as name:
        directory = Path(name)

        def write(pause: Callable[[], object] = lambda: None) -> Path:
            return blackbox_file.write(
                order, directory, max_files=3, max_bytes=blackbox.FILE_BYTES, pause=pause
            )

        started_s, cpu_s = time.perf_counter(), time.process_time()
        path = write()
        print(
            f"a file of 60 s: {path.stat().st_size / 1e6:.1f} MB; written without pauses in "
            f"{time.perf_counter() - started_s:.2f} s, {time.process_time() - cpu_s:.2f} s of CPU"
        )
        never = threading.Event()
        variants: dict[str, Callable[[], object]] = {
            "nothing is written": lambda: time.sleep(1.0),
            "on a thread with pauses": lambda: write(lambda: never.wait(blackbox.PAUSE_S)),
            "on a thread without": write,
        }
        for variant, act in variants.items():
            print(f"lateness, {variant}: {asyncio.run(lateness(act))}", flush=True)


if __name__ == "__main__":
    main()
