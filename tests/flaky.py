"""Repeat the system tests, and list what failed in which run: `make flaky N=10`.

Every third run has two busy loops beside it: load may delay a test, but must not decide whether it passes. The output of
a failed run is kept. Exit 1 if anything failed.
"""

import argparse
import os
import signal
import subprocess
import sys
import time
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import mkdtemp
from xml.etree import ElementTree as ET

ROOT = Path(__file__).parents[1]
SELECTION = ("-m", "not timed and not demo", "--numprocesses=4", "--dist=worksteal")
LOADED_EVERY = 3
BUSY_LOOPS = 2
BUSY = "import os\nparent = os.getppid()\nwhile os.getppid() == parent: pass"
END_LIMIT_S = 30.0
"""Time for an interrupted run to end its processes."""


def main() -> int:
    arguments = _parser().parse_args()
    folder = Path(mkdtemp(prefix="lifeline-flaky-"))
    failed_in: dict[str, list[int]] = {}
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    is_interrupted = False
    try:
        for number in range(1, arguments.runs + 1):
            is_loaded = number % LOADED_EVERY == 0
            with _busy_loops(BUSY_LOOPS if is_loaded else 0):
                began_s = time.monotonic()
                failures, log = _run(arguments.tests, folder / f"run-{number}")
                took_s = time.monotonic() - began_s
                load = os.getloadavg()[0]
            for test in failures:
                failed_in.setdefault(test, []).append(number)
            verdict = f"{len(failures)} failed ({log})" if failures else "passed"
            beside = f", beside {BUSY_LOOPS} busy loops" if is_loaded else ""
            print(f"run {number}: {verdict}, {took_s:.0f} s, load {load:.1f}{beside}", flush=True)
    except KeyboardInterrupt:
        is_interrupted = True
        print("interrupted", flush=True)
    for test, runs in sorted(failed_in.items(), key=lambda item: -len(item[1])):
        print(f"{len(runs)} times, in run {', '.join(map(str, runs))}: {test}")
    return 1 if failed_in else 130 if is_interrupted else 0


def _run(tests: list[str], path: Path) -> tuple[list[str], Path]:
    """Run the tests once; return the failed ones and the file with the output."""
    report, log = path.with_suffix(".xml"), path.with_suffix(".log")
    command = [
        sys.executable,
        "-m",
        "pytest",
        *SELECTION,
        f"--junit-xml={report}",
        *(tests or ["tests/system"]),
    ]
    with log.open("w") as output:
        # Ctrl-C must reach it once, whether or not a terminal sends it to the whole group.
        pytest = subprocess.Popen(command, cwd=ROOT, stdout=output, stderr=output, process_group=0)
        try:
            code = pytest.wait()
        finally:
            if pytest.poll() is None:
                os.killpg(pytest.pid, signal.SIGINT)
                with suppress(subprocess.TimeoutExpired):
                    pytest.wait(END_LIMIT_S)
                if pytest.poll() is None:
                    os.killpg(pytest.pid, signal.SIGKILL)
                    pytest.wait()
    failures = _failures(report) if report.exists() else []
    if code and not failures:
        return [f"pytest ended with code {code}"], log
    return failures, log


def _failures(report: Path) -> list[str]:
    """Return the names of the tests that failed, or whose fixtures did."""
    return sorted(
        {
            f"{case.get('classname', '').replace('.', '/')}.py::{case.get('name')}"
            for case in ET.parse(report).iter("testcase")
            if case.find("failure") is not None or case.find("error") is not None
        }
    )


@contextmanager
def _busy_loops(count: int) -> Generator[None]:
    """Load the machine with processes that also end with this one."""
    loops = [subprocess.Popen([sys.executable, "-c", BUSY]) for _ in range(count)]
    try:
        yield
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m tests.flaky",
        description="Repeat the system tests, every third time beside two busy loops; list what failed in which run.",
    )
    parser.add_argument("--runs", type=int, default=10, help="set the number of runs (default: 10)")
    parser.add_argument(
        "tests",
        nargs=argparse.REMAINDER,
        help="select tests, and pass further options to pytest (default: tests/system)",
    )
    return parser


if __name__ == "__main__":
    sys.exit(main())
