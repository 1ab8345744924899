"""The effect of orders on a faulty process, in separate processes with a real event loop."""

import os
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from faults.real.rig.faulty_process import CRASH_CODE, DIRECTORY, obey
from supervisor import service
from supervisor.law.reckoning import Velocity
from wire.messages import planar_twist

LOOP = """
    import asyncio, os, signal, sys, time
    from faults.real.rig.faulty_process import obey

    async def main():
        loop = asyncio.get_running_loop()
        failed = loop.create_future()
        loop.set_exception_handler(lambda _, context: failed.set_result(type(context["exception"]).__name__))
        signal.signal(signal.SIGUSR1, lambda *_: obey(sys.argv[1]))
        began_s = time.monotonic()
        os.kill(os.getpid(), signal.SIGUSR1)
        await asyncio.sleep(0.01)
        print(round(time.monotonic() - began_s, 2))
        if sys.argv[1] == "raise":
            print(await asyncio.wait_for(failed, 5))

    asyncio.run(main())
"""


def _said(order: str) -> list[str]:
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(LOOP), order],
        capture_output=True,
        text=True,
        check=True,
        timeout=30,
    )
    return done.stdout.split()


@pytest.mark.parametrize("order", ["block 0.3", "gil 0.3"])
def test_nothing_runs_in_the_loop_while_it_is_held(order: str) -> None:
    assert float(_said(order)[0]) >= 0.29


def test_an_exception_reaches_whoever_hears_of_those_that_nobody_awaits() -> None:
    assert _said("raise")[1] == "InjectedError"


def test_the_clock_that_commands_are_stamped_with_steps_and_steps_back(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from wire import stamp  # noqa: PLC0415 - the module itself is changed

    monkeypatch.setattr(stamp, "time", stamp.time)
    stamper = stamp.Stamper()
    before_ns = stamper.next().source_time_ns
    obey("clock 3600")
    assert 3600e9 <= stamper.next().source_time_ns - before_ns < 3660e9
    obey("clock -3600")
    assert 0 <= stamper.next().source_time_ns - before_ns < 60e9


def test_an_order_that_there_is_not_is_an_error() -> None:
    with pytest.raises(ValueError, match="no such order: 'dance'"):
        obey("dance")


def test_a_process_in_a_crash_loop_ends_as_it_starts(tmp_path: Path) -> None:
    (tmp_path / "crash-sim").touch()
    done = subprocess.run(
        [sys.executable, "-m", "faults.real.rig.faulty_process", "-m", "sim"],
        env=os.environ | {DIRECTORY: str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
        timeout=30,
    )
    assert (done.returncode, done.stderr) == (
        CRASH_CODE,
        "ends as it starts, as the fault campaign wants it\n",
    )


def test_an_armed_process_is_run_as_if_it_were_not(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "faults.real.rig.faulty_process", "-m", "supervisor", "--help"],
        env=os.environ | {DIRECTORY: str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert done.returncode == 0
    assert done.stdout.startswith("usage: python -m supervisor")
    assert signal.getsignal(signal.SIGUSR1) is signal.SIG_DFL


def test_the_next_motion_that_is_decided_is_said_later(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(service, "to_twist", service.to_twist)
    slept_s: list[float] = []
    monkeypatch.setattr("time.sleep", slept_s.append)
    obey("decided 0.7")
    assert service.to_twist(Velocity(0.0, 0.0)) == planar_twist(0.0, 0.0)
    assert slept_s == []
    for _ in range(2):
        assert service.to_twist(Velocity(0.5, 0.1)) == planar_twist(0.5, 0.1)
        assert slept_s == [0.7], "once"
