"""Short runs of `python -m bench.link` in real network namespaces, and what is left after it was interrupted."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from bench.link.namespaces import NAMED, remove_leftovers, why_not
from bench.link.results import Link, read
from bench.rig.program import ROOT
from tests.system.harness import PATIENCE_S
from tests.system.process_state import children_of

RUN_LIMIT_S = 100.0
BENCH = (sys.executable, "-m", "bench.link")
LONG = ("--links", "tcp", "--loss-percent", "0", "--round-trip-ms", "0", "--flows", "1", "--seconds", "600")

pytestmark = pytest.mark.timeout(110)
reason = why_not()
needs_root = pytest.mark.skipif(reason is not None, reason=str(reason))


def namespaces_of(pid: int) -> list[str]:
    return sorted(path.name for path in NAMED.glob(f"lifeline-link-{pid}-*"))


@needs_root
@pytest.mark.timed  # other tests on both cores would cost a link its lease
def test_a_short_run_measures_each_link_without_and_with_losses(tmp_path: Path) -> None:
    file = tmp_path / "link.jsonl"
    words = [
        "--loss-percent",
        "0",
        "50",
        "--round-trip-ms",
        "20",
        "--flows",
        "1",
        "--seconds",
        "6",
        "--late-ms",
        "500",
    ]
    with subprocess.Popen(
        [*BENCH, *words, "--json", file],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ) as process:
        output, _ = process.communicate(timeout=RUN_LIMIT_S)
    assert namespaces_of(process.pid) == []
    results = read(file)
    assert process.returncode == 0, output
    [made] = results.rounds
    assert made.flows == 6
    assert made.packets > 6 * 6 * 20
    assert made.lost > 0
    by_place = {(one.link, one.loss): one for one in results.measured}
    assert len(by_place) == 6
    for link in Link:
        clean, lossy = by_place[link, 0.0], by_place[link, 0.5]
        assert clean.arrived > 100
        assert clean.links_lost == 0
        # Half of the packets are lost: three in a row several times in six seconds.
        assert lossy.stops + lossy.disturbed_stops > clean.stops
        assert lossy.worst_age_s > 0.2


@needs_root
def test_a_round_in_which_the_bench_itself_was_late_is_rejected_and_not_stored(tmp_path: Path) -> None:
    file = tmp_path / "link.jsonl"
    words = [
        "--links",
        "udp",
        "--loss-percent",
        "0",
        "--round-trip-ms",
        "0",
        "--flows",
        "1",
        "--seconds",
        "1",
    ]
    done = subprocess.run(
        [*BENCH, *words, "--late-ms", "1e-6", "--json", file],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=RUN_LIMIT_S,
        check=False,
    )
    assert done.returncode == 1
    assert "round 1 is rejected: the router was" in done.stderr
    assert not file.exists()


@needs_root
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_run_removes_its_namespaces_and_ends_its_programs(number: signal.Signals) -> None:
    with running() as process:
        process.send_signal(number)
        output, _ = process.communicate(timeout=PATIENCE_S)
    assert "Traceback" not in output
    assert process.returncode == 128 + number
    assert namespaces_of(process.pid) == []


@needs_root
def test_the_next_run_removes_what_a_killed_run_has_left() -> None:
    with running() as process:
        inside = [
            int(pid)
            for name in namespaces_of(process.pid)
            for pid in subprocess.check_output(["ip", "netns", "pids", name], text=True).split()
        ]
        assert len(inside) == 2, "sender and receiver"
        assert len(namespaces_of(process.pid)) == 2
        process.kill()
        process.communicate(timeout=PATIENCE_S)
    # The run of another test may remove them first.
    wait_until(lambda: not any(Path(f"/proc/{pid}").exists() for pid in inside), "the programs ended")
    remove_leftovers()
    assert namespaces_of(process.pid) == []


@contextmanager
def running() -> Generator["subprocess.Popen[str]"]:
    """Run the bench until its three programs run; at the end, kill it if it still runs."""
    process = subprocess.Popen(
        [*BENCH, *LONG], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    try:
        wait_until(lambda: programs(process.pid) == {"relay", "receiver", "sender"}, "three programs run")
        yield process
    finally:
        process.kill()
        process.communicate()


def programs(pid: int) -> set[str]:
    """Return the names of the bench's programs that are children of a process."""
    found: set[str] = set()
    for child in children_of(pid):
        with suppress(OSError):  # it has ended
            words = Path(f"/proc/{child}/cmdline").read_text().split("\0")
            if "-m" in words:
                module, argument = words[2:4]
                found.add(argument if module == "bench.link.flows" else module.removeprefix("bench.link."))
    return found


def wait_until(condition: Callable[[], bool], what: str) -> None:
    until_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < until_s, f"not seen within {PATIENCE_S:g} s: {what}"
        time.sleep(0.01)


@pytest.mark.parametrize(
    ("words", "environment", "sentence"),
    [
        (("--loss-percent", "101"), {}, "from 0 to 100"),
        (("--round-trip-ms", "-1"), {}, "of at least 0"),
        (("--lease-s", "0"), {}, "greater than 0"),
        (("--flows", "0"), {}, "of at least 1"),
        (("--seconds", "nan"), {}, "greater than 0"),
        (("--links", "tls"), {}, "invalid Link value"),
        ((), {"PATH": "/nonexistent"}, "iproute2" if os.geteuid() == 0 else "root"),
    ],
)
def test_what_cannot_be_measured_is_refused_in_one_sentence(
    words: tuple[str, ...], environment: dict[str, str], sentence: str
) -> None:
    done = subprocess.run(
        [*BENCH, *words],
        cwd=ROOT,
        env=os.environ | environment,
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )
    assert done.returncode in {1, 2}
    assert "Traceback" not in done.stderr
    assert sentence in done.stderr.splitlines()[-1]
