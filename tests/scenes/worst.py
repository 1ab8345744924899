"""Search for the worst case: an optimizer searches for the drive in which the hull comes closest to an object.

    python -m tests.scenes.worst --evaluations 20000
    python -m tests.scenes.worst --evaluations 20000 --alone
    python -m tests.scenes.worst --evaluations 2000 --leave-out dead_s --leave-out latency_s

Each drive has its own dead time, brakes, latency, base timeout, noise, lost scans, vanishing returns, hull, object and commands.
The configuration contains the first four, except those that are left out. With `--alone`, the optimizer minimizes the clearance
after every process above the base has died at the worst tick. It prints the worst drive of each climb.
"""

import argparse
import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, fields, replace
from typing import NamedTuple

import numpy as np

from bench.rig.options import count, failing_in_a_sentence, seed
from supervisor.law.clearance import Circle
from supervisor.law.reckoning import STANDSTILL, Pose, Velocity
from tests.scenes.operators import SETTLE_S
from tests.scenes.run import TICK_S, Moment, advance, base_of, dead_ticks, run
from tests.scenes.scene import SMALLEST_M, TRUSTED_M_S2, BaseNumbers, Configured, Scene, rectangle
from tests.scenes.sensing import Ranges
from tests.scenes.simple import LIDAR, plain_scene
from tests.scenes.world import Floats, Measure, World

HULLS = (Circle(0.25), rectangle(0.4, 0.4, 0.2), rectangle(0.55, 0.15, 0.25))
ROOM_M = 5.0
"""All walls are nearer than 0.8 of the lidar's range, within which vanished returns are judged (supervisor/law/silence.py)."""
DURATION_S = 4.0
CONFIGURABLE = ("dead_s", "latency_s", "braking_m_s2", "timeout_s")
"""Parameters that a configuration contains unless they are left out."""


@dataclass(frozen=True)
class Case:
    """The parameters of one drive."""

    dead_s: float
    braking_m_s2: float
    latency_s: float
    timeout_s: float
    """Time after which the base stops without a command."""
    noise_m: float
    lost_scans: float
    """Fraction of the scans that never arrive."""
    vanish_rad: float
    """Width of the sector whose returns vanish between two scans, as "no return"; no sector below `VANISHES_RAD`."""
    vanish_at_rad: float
    vanish_s: float
    rate_hz: float
    acceleration_m_s2: float
    axes: float
    """0.5 and more: each axis of the base has its own ramp."""
    odometry: float
    """Below 0.2: no odometry."""
    hull: float
    object_m: float
    """Distance of the object from the origin."""
    object_rad: float
    object_radius_m: float
    """Above `WALL_M`, the object is a slanted wall."""
    slant_rad: float
    speed_m_s: float
    turn_rad_s: float
    """Below 0.5 rad/s, no turn; the same for `then_rad_s`."""
    then_m_s: float
    then_rad_s: float
    then_s: float
    """Time at which the second twist follows the first."""


VANISHES_RAD = math.radians(10.0)
"""The law claims nothing about narrower ones (docs/decisions/0066-vanished-returns.md)."""
WALL_M = 0.25

RANGES: dict[str, tuple[float, float]] = {
    "dead_s": (0.0, 0.2),
    "braking_m_s2": (0.5 * TRUSTED_M_S2, 1.5 * TRUSTED_M_S2),
    "latency_s": (0.0, 0.15),
    "timeout_s": (0.02, 0.5),
    "noise_m": (0.0, 0.03),
    "lost_scans": (0.0, 0.3),
    "vanish_rad": (0.0, math.pi),
    "vanish_at_rad": (-1.0, 1.0),
    "vanish_s": (0.5, 3.0),
    "rate_hz": (5.0, 40.0),
    "acceleration_m_s2": (0.5, 2.0),
    "axes": (0.0, 1.0),
    "odometry": (0.0, 1.0),
    "hull": (0.0, len(HULLS) - 1e-9),
    "object_m": (0.9, 3.0),
    "object_rad": (-0.5, 0.5),
    "object_radius_m": (SMALLEST_M / 2, 2.0 * WALL_M),
    "slant_rad": (-1.2, 1.2),
    "speed_m_s": (0.3, 1.0),
    "turn_rad_s": (-1.2, 1.2),
    "then_m_s": (-1.0, 1.0),
    "then_rad_s": (-2.0, 2.0),
    "then_s": (0.5, 3.0),
}


class Result(NamedTuple):
    """Least clearances of one drive [m]."""

    driven_m: float
    """While the law decides."""
    alone_m: float
    """After every process above the base has died at the worst tick."""


class Course:
    """Commands one twist, then another; neutral during each stop."""

    def __init__(self, case: Case) -> None:
        self._first = Velocity(case.speed_m_s, _beyond(case.turn_rad_s, 0.5))
        self._then = Velocity(case.then_m_s, _beyond(case.then_rad_s, 0.5))
        self._then_s = case.then_s

    def asks(self, now_s: float, pose: Pose, twist: Velocity, *, stopped: bool) -> Velocity:
        if stopped or now_s < SETTLE_S:
            return STANDSTILL
        return self._first if now_s < self._then_s else self._then


def _beyond(value: float, threshold: float) -> float:
    """Return zero if the absolute value is at most the threshold, else the value."""
    return 0.0 if abs(value) <= threshold else value


def case_of(genes: Floats) -> Case:
    """Return the case for numbers from 0 to 1, one for each parameter."""
    drawn = {
        field.name: low + gene * (high - low)
        for field, gene in zip(fields(Case), genes.tolist(), strict=True)
        for low, high in (RANGES[field.name],)
    }
    for name in ("dead_s", "timeout_s"):  # the base acts on ticks
        drawn[name] = round(drawn[name] / TICK_S) * TICK_S
    return Case(**drawn)


def text_of(case: Case) -> str:
    """Return a case as text, with four digits for each parameter."""
    return ", ".join(f"{name} {value:.4g}" for name, value in asdict(case).items())


def case_from(text: str) -> Case:
    """Return the case of a text; parameters that it leaves out have the middle of their range."""
    numbers = {name: float(value) for name, value in (part.split() for part in text.split(","))}
    return replace(case_of(np.full(len(RANGES), 0.5)), **numbers)


def genes_of(case: Case) -> Floats:
    """Return the numbers from 0 to 1 of a case, one for each parameter."""
    return np.array([(getattr(case, name) - low) / (high - low) for name, (low, high) in RANGES.items()])


HARD = case_from(
    "dead_s 0.1, braking_m_s2 1.125, latency_s 0.075, timeout_s 0.3, noise_m 0.002, lost_scans 0, vanish_rad 0, rate_hz 20,"
    "acceleration_m_s2 2, axes 0, odometry 1, hull 0, object_m 3, object_rad 0, object_radius_m 0.1, speed_m_s 1,"
    "turn_rad_s 0, then_m_s 1, then_rad_s 0, then_s 3"
)
"""A drive straight at a pillar at full speed."""


def scene_of(case: Case, left_out: frozenset[str] = frozenset()) -> Scene:
    """Build the scene of a case.

    Args:
        case: the parameters.
        left_out: names of parameters for which the configuration has the defaults.
    """
    hull = HULLS[int(case.hull)]
    x_m, y_m = (case.object_m * math.cos(case.object_rad), case.object_m * math.sin(case.object_rad))
    lidar = replace(LIDAR, rate_hz=case.rate_hz, noise_m=case.noise_m, latency_s=case.latency_s)
    base = BaseNumbers(
        "axis" if case.axes >= 0.5 else "mixture", case.acceleration_m_s2, case.braking_m_s2, case.dead_s
    )
    scene = plain_scene(
        (x_m, y_m, min(case.object_radius_m, WALL_M)),
        hull=hull,
        lidars=(lidar,),
        base=base,
        room_m=ROOM_M,
        duration_s=DURATION_S,
    )
    if case.object_radius_m > WALL_M:
        half = 1.5 * np.array((-math.sin(case.slant_rad), math.cos(case.slant_rad)))
        middle, world = np.array((x_m, y_m)), scene.world
        world = World(
            np.vstack((middle - half, world.starts[1:])),
            np.vstack((middle + half, world.ends[1:])),
            np.concatenate(((SMALLEST_M / 2,), world.radii[1:])),
        )
        start_m = float(Measure(hull).clearances_m(world, 0.0, 0.0, 0.0).min())
        scene = replace(scene, world=world, start_m=start_m)
    configured = {name: getattr(case, name) for name in CONFIGURABLE if name not in left_out}
    if "braking_m_s2" in configured:  # the worse of the configured and the measured deceleration
        configured["braking_m_s2"] = min(TRUSTED_M_S2, case.braking_m_s2)
    scale = None if case.odometry < 0.2 else 1.0
    return replace(scene, odometry_scale=scale, configured=Configured(**configured))


def drive(case: Case, left_out: frozenset[str] = frozenset(), *, alone: bool = True) -> Result:
    """Run one drive; without `alone`, the second result is not computed.

    A scene that begins nearer than the stop distance plus 10 cm counts as one that keeps its distance.
    """
    scene = scene_of(case, left_out)
    if scene.start_m < 0.4:
        return Result(math.inf, math.inf)
    moments: list[Moment] = []
    rng = np.random.default_rng(1)
    eye = scene.lidars[0]
    angle = eye.angle_min + eye.angle_increment * np.arange(eye.beams)
    gone = np.abs(angle - case.vanish_at_rad) <= case.vanish_rad / 2.0

    def spoil(taken_s: float, number: int, ranges: Ranges) -> Ranges | None:
        if rng.random() < case.lost_scans:
            return None
        if taken_s > case.vanish_s and case.vanish_rad >= VANISHES_RAD:
            ranges[gone] = math.inf
        return ranges

    outcome = run(scene, operator=Course(case), spoil=spoil, watch=moments.append)
    return Result(outcome.closest_m, left_alone_m(scene, case.timeout_s, moments) if alone else math.nan)


def left_alone_m(scene: Scene, timeout_s: float, moments: list[Moment]) -> float:
    """Return the least clearance if every process above the base dies at the worst tick, right after its decision.

    The base then follows the decisions that are still in transit, the last one for its timeout, and then brakes to zero.
    """
    measure, dead, radius_m = Measure(scene.hull), dead_ticks(scene), scene.hull.radius_m
    outputs = [STANDSTILL] * (1 + dead) + [moment.decision.output for moment in moments]
    held, least_m = round(timeout_s / TICK_S), math.inf
    for number, moment in enumerate(moments):
        queue = outputs[number : number + dead + 2]
        fastest_m_s = max(abs(v) + abs(w) * radius_m for v, w in (moment.twist, *queue))
        reacts_s = TICK_S * (len(queue) + held) + fastest_m_s / scene.base.braking_m_s2
        clearance_m = float(measure.clearances_m(scene.world, *moment.pose).min())
        if fastest_m_s > 0.0 and clearance_m - fastest_m_s * reacts_s < least_m:
            followed = (*queue, *[queue[-1]] * (held - 1))
            least_m = min(least_m, _followed_m(scene, measure, moment, followed))
    return least_m


def _followed_m(scene: Scene, measure: Measure, moment: Moment, commands: Sequence[Velocity]) -> float:
    """Return the least clearance of a base that follows commands, one for each tick, and then brakes to standstill."""
    base, pose, least_m, left = base_of(scene), moment.pose, math.inf, deque(commands)
    base.twist = moment.twist
    while left or base.twist != STANDSTILL:
        was = base.twist
        now = base.step(left.popleft() if left else STANDSTILL, TICK_S)
        mean = Velocity((was.linear_m_s + now.linear_m_s) / 2, (was.angular_rad_s + now.angular_rad_s) / 2)
        pose = advance(pose, mean, TICK_S)
        least_m = min(least_m, float(measure.clearances_m(scene.world, *pose).min()))
    return least_m


# --- the optimizer

FIRST = 40
"""A climb begins at the worst of this many random cases. In the first climb, `HARD` is one of them."""
PATIENCE = 60
"""A climb ends after this many cases without progress."""
CHANGED = 0.2
"""Share of the parameters that change in one step."""
STEPS = (-2.0, -0.3)
"""Exponents of the least and the greatest standard deviation of a step, as a share of a parameter's range."""
PROGRESS_M = 1e-4


class Found(NamedTuple):
    """The worst case of one climb."""

    score: float
    case: Case


def search(score: Callable[[Case], float], evaluations: int, number: int) -> list[Found]:
    """Minimize a score by random steps with restarts; return the worst case of each climb.

    Args:
        score: function of a case that is minimized.
        evaluations: how often the score may be computed.
        number: seed of all random numbers.
    """
    rng = np.random.default_rng([number, 7])
    size, found = len(fields(Case)), list[Found]()
    while evaluations > 0:
        drawn = rng.random((min(FIRST, evaluations), size))
        if not found:
            drawn[0] = genes_of(HARD)
        values = [score(case_of(genes)) for genes in drawn]
        evaluations -= len(drawn)
        genes, least, idle = drawn[int(np.argmin(values))], min(values), 0
        while evaluations > 0 and idle < PATIENCE:
            step = 10.0 ** rng.uniform(*STEPS) * rng.standard_normal(size)
            tried = np.clip(genes + np.where(rng.random(size) < CHANGED, step, 0.0), 0.0, 1.0)
            value = score(case_of(tried))
            evaluations -= 1
            idle = 0 if value < least - PROGRESS_M else idle + 1
            if value <= least:  # also an equal score: not every parameter has an effect at the present case
                genes, least = tried, value
        found.append(Found(least, case_of(genes)))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m tests.scenes.worst",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--evaluations", type=count, default=600, help="run this many drives")
    parser.add_argument("--seed", type=seed, default=0, help="set the seed of the optimizer")
    parser.add_argument(
        "--alone", action="store_true", help="let every process above the base die at the worst tick"
    )
    parser.add_argument(
        "--leave-out",
        action="append",
        default=[],
        choices=CONFIGURABLE,
        help="leave this parameter out of the configuration; repeatable",
    )
    args = parser.parse_args()
    left_out = frozenset(args.leave_out)

    def score(case: Case) -> float:
        driven_m, alone_m = drive(case, left_out, alone=args.alone)
        return alone_m if args.alone else driven_m

    with failing_in_a_sentence("tests.scenes.worst"):
        found = search(score, args.evaluations, args.seed)
    for one in sorted(found, key=lambda one: one.score):
        print(f"{one.score:.4f} m: {text_of(one.case)}")


if __name__ == "__main__":
    main()
