"""The kernel ends a process whose loop has taken no turn for its limit; each process here is a real one."""

import signal
import subprocess
import sys
import time

import pytest

LIMIT_S = 0.2
MARGIN_S = 0.5
PATIENCE_S = 20.0
BEGIN = f"""
import ctypes, math, signal, sys, threading, time
from wire.host import notify
notifier = notify.Notifier(turn_limit_s={LIMIT_S})
def take_a_turn():
    notifier.running(time.monotonic())
"""
LAST_TURN = """
take_a_turn()
print(time.monotonic(), flush=True)
"""
HANGS = {
    "a lock": "lock = threading.Lock(); lock.acquire(); lock.acquire()",
    "the interpreter's lock": "ctypes.PyDLL(None).sleep(60)",
    "the interpreter's lock on another thread": "threading.Thread(target=ctypes.PyDLL(None).sleep, args=(60,)).start(); time.sleep(60)",
    "an endless loop": "while True: pass",
}


def run(*lines: str, begin: str = BEGIN) -> tuple[int, str, float]:
    """Run a program; return its exit code, its output, and the time of its end by the monotonic clock."""
    with subprocess.Popen(
        [sys.executable, "-c", "\n".join([begin, *lines])], stdout=subprocess.PIPE, text=True
    ) as process:
        output, _ = process.communicate(timeout=PATIENCE_S)
        return process.returncode, output, time.monotonic()


@pytest.mark.parametrize("hang", HANGS.values(), ids=HANGS)
def test_a_process_that_hangs_is_ended_at_its_limit_even_while_a_lock_is_held(hang: str) -> None:
    code, last_turn, ended_s = run(LAST_TURN, hang)
    assert code == -signal.SIGALRM
    assert LIMIT_S - 0.01 <= ended_s - float(last_turn) < LIMIT_S + MARGIN_S


def test_each_turn_renews_the_whole_limit() -> None:
    code, output, _ = run(
        "for _ in range(3):",
        "    take_a_turn()",
        "    left_s, period_s = signal.getitimer(signal.ITIMER_REAL)",
        f"    print({LIMIT_S / 2} < left_s <= {LIMIT_S}, period_s)",
        f"    time.sleep({LIMIT_S / 2})",
        "notifier.stopping()",
    )
    assert (code, output) == (0, "True 0.0\n" * 3)


def test_a_start_may_take_longer_than_the_limit() -> None:
    code, output, _ = run(
        f"time.sleep({1.5 * LIMIT_S})", "print(signal.getitimer(signal.ITIMER_REAL))", "take_a_turn()"
    )
    assert (code, output) == (0, "(0.0, 0.0)\n")


def test_an_end_may_take_longer_than_the_limit_and_is_limited_as_after_a_signal() -> None:
    code, output, _ = run(
        "take_a_turn()",
        "notifier.stopping()",
        f"time.sleep({1.5 * LIMIT_S})",
        "left_s = signal.getitimer(signal.ITIMER_REAL)[0]",
        f"print(0.0 < left_s <= notify.STOP_LIMIT_S - {LIMIT_S})",
    )
    assert (code, output) == (0, "True\n")


def test_without_a_limit_no_timer_is_set() -> None:
    code, output, _ = run(
        "notifier = notify.take_notifier({})",
        "take_a_turn()",
        "print(signal.getitimer(signal.ITIMER_REAL))",
        "notifier.stopping()",
        "print(signal.getitimer(signal.ITIMER_REAL))",
    )
    assert (code, output) == (0, "(0.0, 0.0)\n(0.0, 0.0)\n")


@pytest.mark.parametrize(
    "inherited",
    [
        "signal.signal(signal.SIGALRM, signal.SIG_IGN)",
        "signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGALRM})",
    ],
)
def test_a_signal_that_its_parent_ignores_or_blocks_still_ends_it(inherited: str) -> None:
    program = f"{BEGIN}{LAST_TURN}time.sleep(60)"
    become = (
        f"import os, signal, sys; {inherited}; os.execv(sys.executable, [sys.executable, '-c', {program!r}])"
    )
    assert run(begin=become)[0] == -signal.SIGALRM


def test_a_child_has_no_limit() -> None:
    code, output, _ = run(
        "import os",
        "take_a_turn()",
        "child = os.fork()",
        "if child == 0:",
        f"    time.sleep({1.5 * LIMIT_S})",
        "    os._exit(3)",
        "notifier.stopping()",
        "print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))",
    )
    assert (code, output) == (0, "3\n")


def test_a_process_that_is_stopped_for_longer_is_ended_when_it_continues() -> None:
    program = f"{BEGIN}{LAST_TURN}time.sleep(60)"
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        process.stdout.readline()
        process.send_signal(signal.SIGSTOP)
        time.sleep(LIMIT_S)  # the stop itself
        assert process.poll() is None
        process.send_signal(signal.SIGCONT)
        assert process.wait(PATIENCE_S) == -signal.SIGALRM
