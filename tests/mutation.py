"""Run the mutation tests of the law, and fail if a mutant survives that is not known to be equivalent.

    python -m tests.mutation             all of them: 20 to 60 minutes on two cores
    python -m tests.mutation --fifth     a fifth of them, of every function, in ten minutes; another one after each change of the law

Exit 1 if any other mutant survives, and print each of these as a diff.
"""

import argparse
import hashlib
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
MUTANTS = ROOT / "mutants"
MUTMUT = [sys.executable, "-m", "mutmut"]
ENVIRONMENT = os.environ | {"LIFELINE_MUTATION": "1"}
"""tests/conftest.py reads it."""

EQUIVALENT = {
    # On the outline the gap is zero, which the other half catches.
    "inside = (depth <= 0.0) | (gap < ON_HULL_M)",
    # What is exactly at the edge of reach limits no motion.
    "(near,) = (around.clearance_m <= keep_m + fastest_m_s * horizon_s).nonzero()",
    "near = np.hypot(earlier[:, 0], earlier[:, 1]) <= config.hull.radius_m + config.reach_m",
    # The beams that are asked lie evenly to both sides.
    "asked = np.rint(beam[left, None] - beams_beside).astype(np.int64)",
    # What its own beam shows, the beams beside it show as well: this only saves time.
    "(left,) = (np.abs(ahead_m + distance_m) > SAME_M).nonzero()",
    "(left,) = (np.abs(ahead_m - distance_m) >= SAME_M).nonzero()",
    # A return at exactly the point's distance shows it again in any case.
    "again = (nearest_m <= distance_m) & (farthest_m > distance_m) & (farthest_m - nearest_m < ONE_SURFACE_M)",
    "again = (nearest_m < distance_m) & (farthest_m >= distance_m) & (farthest_m - nearest_m < ONE_SURFACE_M)",
    # Points in a larger rectangle are looked at: this only saves time.
    "nearest, farthest = places.min(axis=None) - self.hull.radius_m, places.max(axis=0) + self.hull.radius_m",
    "nearest, farthest = places.min(axis=0) - self.hull.radius_m, places.max(axis=None) + self.hull.radius_m",
    # Without this early return, no row is long enough either: it only saves time.
    "if np.count_nonzero(gone) / step_rad < LEAST_RAD:",
    # NaN covers nothing either.
    "free_m = _values_at(view, proven_m, asked, beside=None)",
    # Two shares are equal only if both are zero or both are one: then either does.
    "share, blocking = min(shares, key=None, default=(1.0, None))",
    "share, blocking = min(shares, default=(1.0, None))",
    # One value of a float, among those that a distance or a share may have.
    "agree = np.abs(off_m) < EXPLAINED * error_m",
    "(other,) = (np.abs(returns_m - distance_m[left, None]).min(axis=1) >= SAME_M).nonzero()",
    "leaving, entering = outwards >= NOTHING_M, outwards < -NOTHING_M",
    "leaving, entering = outwards > NOTHING_M, outwards <= -NOTHING_M",
    "inside = (depth < 0.0) | (gap <= ON_HULL_M)",
    "entered = clearance <= keep - GRAZE_M - DEEP_TOLERANCE_M_S * horizon_s",
    "scale = 0.0 if on_its_arc <= PRESENT_SHARE else scale",
    "lost[row] = len(row) * step_rad >= LEAST_RAD and arc_m >= strip_m",
    "if before_m_s > BEGUN_SHARE * braking.mean_m_s:",
    "stopping=mean_m_s >= LEAST_SPEED_M_S and speed_m_s > BEGUN_SHARE * mean_m_s,",
    "return (self.t * self.v - self.n * self.tv) / spread if spread >= LEAST_SPREAD_S2 else math.inf",
    "return np.abs(now - before) <= LEAST_CHANGE_M",
    "if surface_m.sum() <= LEAST_SURFACE_M:",
    "agreeing_m = surface_m[off_m < tolerances_m(surface_m / abs(reference.geometry.increment))].sum()",
    "if agreeing_m <= max(LEAST_SURFACE_M, AGREEING_SHARE * surface_m.sum()):",
    "is_edge = np.abs(first_m + last_m - 2.0 * old_m) >= 2.0 * tolerances_m(old_m)",
    "shows = (np.abs(sensitivity) > LEAST_SENSITIVITY) & ~is_edge",
    "if not 0.0 < shown_m_s2 < GREATEST_M_S2:",
    "if base.moving_s is not None and now_s - base.moving_s >= follows_after_s:",
    "if farther_m < decided.stop_distance_m - TOUCH_M:",
    "return min(dead_s, LONGEST_DEAD_S) if dead_s >= braking.gap_s / 2.0 + SAMPLING_S else 0.0",
    # Advice belongs to a block.
    'advice = "XXXX" if block is None else sights.advice(config, usable, block)',
    # With nothing to spare, the root is the same.
    "return np.where(spare <= 0.0, 0.0, np.maximum(root, 0.0))",
    # A base exactly as fast as permitted drives no farther than one that was so before.
    "if present >= scale:",
    "if present >= limit[0]:  # the bound is convex: its left side is largest at an end",
    # numpy computes any negative dimension, and adds in a wider type by itself.
    "for first, end in edges.reshape(-2, 2).tolist():",
    "pairs: Counts = np.add.reduce(agree.view(np.int8), dtype=None)",
    "pairs: Counts = np.add.reduce(agree.view(np.int8), )",
    "if fit.share > EXPLAINED_SHARE",
    "agrees = view.hit & (error_m < tolerance_m)",
    "return _Fit(agrees, view.hit & (error_m >= 2.0 * tolerance_m), share)",
    # `DOUBTS` is two: a judgement that agrees with an earlier one is always the second.
    "not_ruled_out = MISTAKES if (doubts >= DOUBTS) or True else agreement.not_ruled_out",
    "beside = earlier[np.hypot(earlier[:, 0] - block.x_m, earlier[:, 1] - block.y_m) <= SAME_PLACE_M]",
    "return bool((config.hull.clearance(beside) <= now_m + SAME_DEPTH_M).any())",
    # What is exactly on the hull is at once both.
    "return hidden[config.hull.clearance(hidden) >= 0.0]  # no object can be inside the hull",
    # The words name the writers only while they conflict.
    "writers=_conflicts(state, now_s) if (StopReason.SENSOR_CONFLICT in causes) or True else (),",
    # Both have one entry for each lidar.
    "for lidar, state in zip(config.lidars, sight.lidars, ):",
    "for lidar, state in zip(config.lidars, sight.lidars, strict=None):",
    # A base that stands is not faster than permitted: this only saves time.
    "around.clearance_m.take(closed_on), barrier, present * closing if (present > 0.0) or True else None",
    "around.clearance_m.take(closed_on), barrier, present * closing if present >= 0.0 else None",
    # The angle between two beams is never zero.
    "low, high = ends if sign * increment >= 0.0 else reversed(ends)",
    # Nothing was lost either.
    "source = source._replace(lost=None)  # another run commands now",
    # Then the hidden places are looked for at each tick: the same ones.
    "return sight._replace(places=tuple(places), looking=None)",
    "return sight._replace(places=tuple(places), )",
    # After the last beam there is a NaN.
    "return np.append(ranges_m, math.nan).take(np.where((beams >= 0) & (beams <= number), beams, number))",
    # The first iteration replaces both arrays.
    "slip_m, off_m, surface_m = 0.0, np.empty(1), np.empty(0)",
    "slip_m, off_m, surface_m = 0.0, np.empty(0), np.empty(1)",
}
"""Lines of mutants that behave as the original does."""


def fifth() -> str:
    """Return the pattern of a fifth of the mutants: those whose number ends in one of two digits.

    The digits depend on the mutated files alone: another change does not try other mutants.
    """
    mutated = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["mutmut"]["only_mutate"]
    content = b"".join((ROOT / name).read_bytes() for name in mutated)
    digit = int(hashlib.sha256(content).hexdigest(), 16) % 5
    return f"*[{digit}{digit + 5}]"


def main() -> int:
    parser = argparse.ArgumentParser(description="Mutate the law and check that every mutant fails a test.")
    parser.add_argument(
        "--fifth",
        action="store_true",
        help="try a fifth of the mutants; each change of the law tries another",
    )
    chosen = [fifth()] if parser.parse_args().fifth else []
    shutil.rmtree(MUTANTS, ignore_errors=True)
    try:
        run = subprocess.run(
            [*MUTMUT, "run", *chosen], cwd=ROOT, env=ENVIRONMENT, capture_output=True, text=True, check=False
        )
        counts = re.findall(r"(\d+)/(\d+)\s+🎉 (\d+)", run.stdout)
        if not counts:
            print(run.stdout[-2000:], run.stderr[-2000:], sep="\n")
            print("mutation: the run did not come to an end; is every unit test green without mutants?")
            return 1
        results = subprocess.run(
            [*MUTMUT, "results"], cwd=ROOT, capture_output=True, text=True, check=True
        ).stdout
        # A mutant that hangs is killed, too: by its time limit.
        survivors = re.findall(r"(\S+__mutmut_\d+): (?:survived|no tests|suspicious)", results)
        unknown = 0
        for name in survivors:
            diff = subprocess.run(
                [*MUTMUT, "show", name], cwd=ROOT, capture_output=True, text=True, check=True
            ).stdout
            added = " ".join(line[1:].strip() for line in diff.splitlines() if re.match(r"\+(?!\+)", line))
            if added not in EQUIVALENT:
                unknown += 1
                print(diff)
        tried, total, killed = counts[-1]
        print(
            f"mutation: {tried} of {total} mutants tried, {killed} killed, {len(survivors)} survived, "
            f"{unknown} of them not known to be equivalent"
        )
        return 1 if unknown else 0
    finally:
        shutil.rmtree(MUTANTS, ignore_errors=True)


if __name__ == "__main__":
    sys.exit(main())
