"""`python -m faults.real.rig.faulty_process -m NODE …`: run a node in which a signal triggers faults.

The node's code is unchanged: it is imported and run as by `python -m NODE …`. On SIGUSR1, the main thread reads
the order in `$LIFELINE_FAULTS_DIR/order-NODE`:

    block SECONDS   block the event loop for this time
    decided SECONDS decide the supervisor's next motion, and send it this much later; nothing else runs meanwhile
    gil SECONDS     hold the interpreter's lock in a thread for this time, so that no Python runs
    raise           raise an uncaught exception
    clock SECONDS   step the clock of the command stamps by this time

The file `route-NODE` contains the endpoint to connect to. While the file `crash-NODE` exists, the node ends at its
start. A sim writes its true motion to the pipe `wheels`.
"""

import asyncio
import ctypes
import fcntl
import os
import runpy
import signal
import sys
import termios
import threading
import time
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, NoReturn

if TYPE_CHECKING:
    from sim.plant import Plant
    from supervisor.law.reckoning import Velocity
    from wire.messages import Twist

DIRECTORY = "LIFELINE_FAULTS_DIR"
ORDER, ROUTE, CRASH = "order", "route", "crash"
WHEELS = "wheels"
SAMPLE_STEPS = 5
"""Physics steps between two samples: 10 ms."""
CRASH_CODE = 17


class InjectedError(RuntimeError):
    """The exception that the campaign injects."""


def main() -> None:
    directory = Path(os.environ[DIRECTORY])
    _, node, *arguments = sys.argv[1:]
    if (directory / f"{CRASH}-{node}").exists():
        print("ends as it starts, as the fault campaign wants it", file=sys.stderr)
        raise SystemExit(CRASH_CODE)
    route = directory / f"{ROUTE}-{node}"
    if route.exists():
        arguments[arguments.index("--endpoint") + 1] = route.read_text()
    order = directory / f"{ORDER}-{node}"

    def on_signal(_number: int, _frame: object) -> None:
        obey(order.read_text())

    signal.signal(signal.SIGUSR1, on_signal)
    if node == "teleop":
        # The screen becomes the controlling terminal, as in a shell, so that closing it sends SIGHUP.
        fcntl.ioctl(1, termios.TIOCSCTTY, 0)
    if node == "sim":
        _tap(directory / WHEELS)
    sys.argv[1:] = arguments
    runpy.run_module(f"{node}.__main__", run_name="__main__", alter_sys=True)


def obey(order: str) -> None:
    """Execute the order in the main thread."""
    match order.split():
        case ["block", seconds]:
            time.sleep(float(seconds))
        case ["decided", seconds]:
            _hold_back(float(seconds))
        case ["gil", seconds]:
            hold = ctypes.PyDLL(None).usleep  # a call through PyDLL keeps the lock
            threading.Thread(target=hold, args=(round(float(seconds) * 1e6),), daemon=True).start()
        case ["raise"]:
            asyncio.get_running_loop().call_soon_threadsafe(_fail)
        case ["clock", seconds]:
            _step_clock(round(float(seconds) * 1e9))
        case _:
            raise ValueError(f"no such order: {order!r}")


def _hold_back(held_s: float) -> None:
    from supervisor import service  # noqa: PLC0415 - this process is one by now

    to_twist = service.to_twist

    def held_up(velocity: "Velocity") -> "Twist":
        if any(velocity):
            service.to_twist = to_twist
            time.sleep(held_s)
        return to_twist(velocity)

    service.to_twist = held_up


def _fail() -> NoReturn:
    raise InjectedError("this exception was injected by the fault campaign")


def _step_clock(by_ns: int) -> None:
    from wire import stamp  # noqa: PLC0415 - first the process imports itself as it does without us

    was = stamp.time.monotonic_ns
    stamp.time = SimpleNamespace(monotonic_ns=lambda: was() + by_ns)


def _tap(pipe: Path) -> None:
    """Make every plant of this process report its motion."""
    from faults.real.rig.wheels import WheelSample, WheelWriter  # noqa: PLC0415 - as above
    from faults.seen import Motion  # noqa: PLC0415
    from sim.plant import Plant  # noqa: PLC0415
    from wire.watchdog import BaseReason, Target, Watchdog  # noqa: PLC0415

    writer = WheelWriter(pipe)
    reasons = {reason: index for index, reason in enumerate(BaseReason)}
    step_plant, target_of = Plant.step, Watchdog.target
    reason = BaseReason.NO_COMMAND
    reported = (reason, False)
    steps = 0
    before: tuple[object, float] = (None, 0.0)

    def target(self: Watchdog, now_s: float) -> Target:
        nonlocal reason
        found = target_of(self, now_s)
        reason = found.reason
        return found

    def step(self: "Plant", twist_target: tuple[float, float], n_steps: int = 1) -> None:
        nonlocal steps, reported, before
        step_plant(self, twist_target, n_steps)
        steps += 1
        news = (reason, any(twist_target))
        if steps % SAMPLE_STEPS and news == reported:
            return
        reported = news
        clearance_m = self.clearance_m()
        pillar, clearance_before_m = before
        own_m = clearance_before_m - clearance_m if pillar == self.pillar else 0.0
        before = (self.pillar, clearance_m)
        motion = Motion(
            time.monotonic(),
            *self.true_pose[:2],
            *self.true_velocity,
            clearance_m,
            own_m,
            self.hull_contacts > 0,
        )
        writer.tell(WheelSample(motion, news[1], reasons[reason]))

    Watchdog.target = target
    Plant.step = step


if __name__ == "__main__":
    main()
