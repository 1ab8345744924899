"""Write the measured parts of README.md from stored results.

The parts between `<!-- NAME: generated -->` and `<!-- /NAME -->` are

    film      what the first picture shows: docs/campaign/crash_film.jsonl
    stop      time and distance of a robot whose teleop is killed: docs/campaign/real.jsonl and ros2_crash.jsonl
    passport  what the second picture shows: docs/passports/demo.html
    cost      processor time and memory of the supervision: docs/ros2.md, bench.jsonl and soak.jsonl.gz in docs/campaign
"""

import math
import re

import numpy as np

from bench.process import Load
from bench.rig.stored import read_appended, read_rows
from bench.soak import Sample
from docs.generate import sections
from docs.generate.benches import BENCH
from docs.generate.crash_safety import ROS2, SOAK, result
from docs.generate.draw_crash_animation import DRIVES, SPEED_M_S
from docs.generate.passports import DEMO
from docs.generate.passports import read as read_passport
from docs.generate.ros2_crash import KEEPS, KILL, LIMIT_S
from docs.generate.ros2_crash import read as read_ros2
from faults.report.figures import Campaign, Spread
from passport.summary import sentence

ROS2_PAGE = sections.ROOT / "docs/ros2.md"
TELEOP_KILLED = "teleop_sigkill"


def film() -> str:
    """Return what the animation of the two drives shows."""
    load = sections.load_of([read_rows(DRIVES).run["machine"]])
    return (
        f"*One run each at {SPEED_M_S:.1f} m/s, {load}, SIGKILL at the red bar; "
        "real processes, base and hall simulated.*"
    )


def stop(campaign: Campaign) -> str:
    """Return how long and how far a robot moves after SIGKILL of teleop, and what happens without Lifeline.

    Raises:
        ValueError: the campaign has no measured trial of `teleop_sigkill`.
    """
    found = campaign.find(TELEOP_KILLED)
    if found is None or not (found.stop and found.standstill and found.distance):
        raise ValueError("docs/campaign/real.jsonl contains no measured trial of teleop_sigkill")
    zero_s, still_s, moved_m = found.stop, found.standstill, found.distance
    runs = [
        one.machine
        for one in campaign.provenances
        if "--classes" not in one.command or TELEOP_KILLED in one.command
    ]
    without = [
        one for one in read_ros2(ROS2) if one.fault == KILL and one.robot == KEEPS and not one.lifeline
    ]
    stopped = sum(one.standstill_s is not None for one in without)
    return (
        f"**Measured:** from SIGKILL of teleop, the commanded velocity is zero after {1000 * zero_s.median:.1f} ms, and the robot stands still "
        f"after {still_s.median:.2f} s and {100 * moved_m.median:.0f} cm (medians, n = {len(found.stops)}).\n"
        f"Upper 95 % confidence limits of the 95 % quantiles: {_limit(zero_s, 1000):.1f} ms, "
        f"{_limit(still_s):.2f} s and {_limit(moved_m, 100):.0f} cm.\nReal processes, simulated wheels, {runs[0].partition(',')[0]}, {sections.load_of(runs)}. "
        f"Without Lifeline, a robot that keeps its last command stopped within {LIMIT_S:.0f} s in {stopped} of {len(without)} "
        "trials."
    )


def _limit(found: Spread, factor: float = 1.0) -> float:
    return math.inf if found.limit is None else factor * found.limit


def passport() -> str:
    """Return what the passport of the simulated robot says."""
    record, _ = read_passport(DEMO)
    return f"*The simulated robot's [passport](docs/passport.md): {sentence(record)}*"


def _processor(machine: str) -> str:
    """Return the architecture in a description such as "2 cores (x86_64), load average 0.7 before"."""
    return machine.partition("(")[2].partition(")")[0]


def cost() -> str:
    """Return the cost of a supervisor, a teleop and a process `ros2`.

    Raises:
        ValueError: docs/ros2.md does not have the figures of the process `ros2`, or no stored robot drove or was limited by the barrier.
    """
    bridge = re.search(r"`ros2` needs (\d+ % of a core and \d+ MB)", ROS2_PAGE.read_text())
    if bridge is None:
        raise ValueError("docs/ros2.md has no processor time")
    bench = read_rows(BENCH)
    phases = bench.of("process", Load)
    free, limited = (
        [one.cpu_percent for one in phases if one.mode == mode] for mode in ("DRIVING", "LIMITED")
    )
    if not (free and limited):
        raise ValueError(
            "docs/campaign/bench.jsonl has no phase in which the robot drove, or none in which the barrier limited it"
        )
    machine = bench.run["machine"]
    samples, _ = read_appended(SOAK, Sample)
    used = samples[-1].processes
    return (
        f"* **Cost**: the supervisor takes {np.median(free):.1f} % of a core, {np.median(limited):.1f} % near an obstacle "
        f"({_processor(machine)}, {sections.load_of([machine])}), and {used['supervisor'].rss_bytes / 1e6:.0f} MB after an hour. "
        f"The process `ros2` takes {bridge[1]}; teleop takes {used['teleop'].rss_bytes / 1e6:.0f} MB."
    )


PARTS: sections.Parts = {
    "film": film,
    "stop": lambda: stop(result("real")),
    "passport": passport,
    "cost": cost,
}
