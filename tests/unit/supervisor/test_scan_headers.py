"""The headers' stamps of scans: why scans become too old although they arrive in time."""

from collections.abc import Callable

import numpy as np
import pytest

from supervisor.messages import ScanHeaders
from wire import messages
from wire.bus import Arrival
from wire.messages import LaserScan
from wire.ros import Time
from wire.stamp import Stamp

BEGAN_S = 1_700_000_000.25
PERIOD_S = 0.05


def scan(stamp_s: float) -> LaserScan:
    message = messages.laser_scan(np.full(90, 3.0, np.float32), range_m=(0.1, 12.0), period_s=PERIOD_S)
    seconds, nanoseconds = divmod(round(stamp_s * 1e9), 1_000_000_000)
    message.header.stamp = Time(seconds, nanoseconds)
    return message


def hear(
    headers: ScanHeaders, stamp_s: Callable[[float], float], place: int = 0, attachment: Stamp | None = None
) -> ScanHeaders:
    """Let scans arrive for 5 s; the stamp is a function of the time."""
    for n in range(101):
        headers.hear(place, [Arrival(scan(stamp_s(n * PERIOD_S)), n * PERIOD_S, attachment)])
    return headers


def slow(passed_s: float) -> float:
    return BEGAN_S + 0.9 * passed_s


def constant(_: float) -> float:
    return BEGAN_S


def whole(passed_s: float) -> float:
    return float(int(BEGAN_S + passed_s))


def alternating(passed_s: float) -> float:
    return BEGAN_S + passed_s - 0.15 * (round(passed_s / PERIOD_S) % 2)


def simulated(passed_s: float) -> float:
    return 12.5 + 0.9 * passed_s


@pytest.mark.parametrize(
    ("stamp_s", "problem"),
    [
        (slow, "run at 0.90 of real time, or their delay grows"),
        (constant, "do not change"),
        (whole, "are whole seconds"),
        (alternating, "go back again and again, by up to 0.10 s"),
        (simulated, "run at 0.90 of real time, or their delay grows (simulated time)"),
    ],
)
def test_stamps_that_do_not_run_like_real_time_are_the_problem(
    stamp_s: Callable[[float], float], problem: str
) -> None:
    assert hear(ScanHeaders(["lidar"]), stamp_s).problem == f"the stamps of the lidar's scans {problem}"


def test_stamps_in_real_time_and_undecodable_scans_are_no_problem() -> None:
    headers = hear(ScanHeaders(["lidar"]), lambda t: BEGAN_S + t)
    headers.hear(0, [Arrival(None, 6.0, None)])
    assert headers.problem == ""


def test_with_an_attachment_the_stamps_of_headers_do_not_matter() -> None:
    attachment = Stamp(1, 1, b"A" * 16)
    assert hear(ScanHeaders(["lidar"]), constant, attachment=attachment).problem == ""


def test_of_several_lidars_the_one_with_the_problem_is_named() -> None:
    headers = hear(ScanHeaders(["front", "rear"]), constant, place=1)
    assert headers.problem == "the stamps of the rear's scans do not change"
