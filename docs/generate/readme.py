"""Write the measured parts of README.md from stored results: `python -m docs.generate.readme`.

The parts between `<!-- NAME: generated -->` and `<!-- /NAME -->` are

    film    what the first picture shows: docs/campaign/crash_film.jsonl
    stop    time and distance of a robot whose teleop is killed: docs/campaign/real.jsonl and ros2_crash.jsonl
    cost    processor time and memory of the supervision: docs/bench.md, docs/ros2.md, bench_robots.jsonl and soak.jsonl.gz in docs/campaign

`--check` writes nothing and fails if a part is out of date; tests/unit/test_docs.py does the same.
"""

import math
import re
import sys

import numpy as np

from bench.rig.stored import read_appended, read_rows
from bench.robots.results import read as read_robots
from bench.soak import Sample
from docs.generate import sections
from docs.generate.crash_safety import ROS2, SOAK, result
from docs.generate.draw_crash_animation import DRIVES, SPEED_M_S
from docs.generate.ros2_crash import LIMIT_S, Fault, Robot
from docs.generate.ros2_crash import read as read_ros2
from faults.report.figures import Campaign, Spread

DOCUMENT = sections.ROOT / "README.md"
BENCH, ROS2_PAGE = sections.ROOT / "docs/bench.md", sections.ROOT / "docs/ros2.md"
KILL = "teleop_sigkill"


def film() -> str:
    """Return what the animation of the two drives shows."""
    load = sections.load_of([read_rows(DRIVES).run["machine"]])
    return (
        f"*One run each at {SPEED_M_S:.1f} m/s, {load}: SIGKILL ends the same ROS 2 keyboard node at the red bar; "
        "the processes are real, base and hall simulated.*"
    )


def stop(campaign: Campaign | None) -> str:
    """Return how long and how far a robot moves after SIGKILL of teleop, and what happens without Lifeline."""
    found = None if campaign is None else campaign.find(KILL)
    if campaign is None or found is None or not (found.stop and found.standstill and found.distance):
        return "Not measured yet: `make campaign`."
    zero_s, still_s, moved_m = found.stop, found.standstill, found.distance
    runs = [
        one.machine for one in campaign.provenances if "--classes" not in one.command or KILL in one.command
    ]
    without = [
        one
        for one in read_ros2(ROS2)
        if one.fault is Fault.KILL and one.robot is Robot.KEEPS and not one.lifeline
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


def _processor(machine: str) -> str:
    """Return the architecture in a description such as "2 cores (x86_64), load average 0.7 before"."""
    return machine.partition("(")[2].partition(")")[0]


def cost(bench: str, ros2: str) -> str:
    """Return the cost of a supervisor, a teleop and a process `ros2`.

    Args:
        bench: the text of docs/bench.md.
        ros2: the text of docs/ros2.md, which has the figures of the process `ros2`.

    Raises:
        ValueError: a figure is missing.
    """
    cpu_percent = re.findall(
        r"^\| (?:free path|limited by the barrier) (?:\|[^|\n]*){2}\| *([\d.]+) \|", bench, re.MULTILINE
    )
    machine = re.findall(r"^\* machine: .*", bench, re.MULTILINE)
    bridge = re.search(r"`ros2` needs (\d+ % of a core and \d+ MB)", ros2)
    stored = read_robots()
    if not cpu_percent or bridge is None:
        raise ValueError("docs/bench.md or docs/ros2.md has no processor time")
    quiet = stored.run["machine"]
    one_robot = next(one for one in stored.crowds if one.robots == 1)
    samples, _ = read_appended(SOAK, Sample)
    used = samples[-1].processes
    return (
        f"* **Cost**: the supervisor takes {np.mean(one_robot.cpu_percent):.1f} % of a core "
        f"({_processor(quiet)}, {sections.load_of([quiet])}), up to {max(map(float, cpu_percent)):.1f} % near an obstacle on "
        f"a busy machine ({sections.load_of(machine)}), and {used['supervisor'].rss_bytes / 1e6:.0f} MB after an hour. "
        f"The process `ros2` takes {bridge[1]}; teleop takes {used['teleop'].rss_bytes / 1e6:.0f} MB."
    )


PARTS: sections.Parts = {
    "film": film,
    "stop": lambda: stop(result("real")),
    "cost": lambda: cost(BENCH.read_text(), ROS2_PAGE.read_text()),
}


def regenerated(text: str) -> str:
    """Return the document with its generated parts updated.

    Raises:
        ValueError: a part has no place in the document.
        DeployError: a result is damaged.
    """
    return sections.regenerated(text, PARTS, "README.md")


if __name__ == "__main__":
    sys.exit(sections.main("python -m docs.generate.readme", DOCUMENT, regenerated))
