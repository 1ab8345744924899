"""Search for a scene in which the law lets the hull come too close to an object.

    python -m tests.scenes --seeds 0-20000 --jobs 2
    python -m tests.scenes --replay 1234 --verbose --plot 1234.png

Exit 1 if any scene violates its bound: 0.285 m, or 1.5 cm less than the clearance at the start if that is less.
"""

import argparse
import functools
import multiprocessing
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from bench.rig.options import at_least_zero, count, failing_in_a_sentence, output_file, seed
from tests.scenes.run import Moment, Outcome, run, run_seed
from tests.scenes.scene import Scene, random_scene
from tests.scenes.summary import Summary

PROGRESS_S = 10.0
AROUND_S = 1.4
"""How much of a run is printed before and after its worst moment."""


def main() -> None:
    args = _parse()
    scene_of = functools.partial(random_scene, noise_m=args.noise_m, silent_dirt=args.silent_dirt)
    if args.replay is not None:
        with failing_in_a_sentence("tests.scenes"):
            sys.exit(_replay(scene_of(args.replay), verbose=args.verbose, picture=args.plot))
    with failing_in_a_sentence("tests.scenes"):
        sys.exit(_search(args.seeds, scene_of, args.jobs, args.only, args.list_file))


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m tests.scenes",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--seeds",
        type=seeds,
        default="0-300",
        metavar="FIRST-LAST",
        help="run the seeds from FIRST to LAST - 1, such as 0-20000",
    )
    parser.add_argument("--jobs", type=count, default=1, help="use this many processes")
    parser.add_argument("--only", default="", help="run only scenes with this tag, such as 'dirt'")
    parser.add_argument(
        "--noise-m",
        type=at_least_zero,
        default=0.005,
        metavar="M",
        help="set the largest standard deviation of the range noise",
    )
    parser.add_argument(
        "--silent-dirt", action="store_true", help="let dirt read as the profile's 'no return'"
    )
    parser.add_argument(
        "--list-file", type=output_file, metavar="FILE", help="write the seeds of all violations to this file"
    )
    parser.add_argument("--replay", type=seed, metavar="SEED", help="run one scene and print its figures")
    parser.add_argument(
        "--verbose", action="store_true", help="with --replay: print the ticks around the worst moment"
    )
    parser.add_argument("--plot", type=output_file, metavar="PNG", help="with --replay: draw the run")
    args = parser.parse_args()
    if args.replay is None and (args.verbose or args.plot is not None):
        parser.error("--verbose and --plot need --replay SEED")
    return args


def seeds(text: str) -> range:
    """Return the seeds from FIRST to LAST - 1 of a text FIRST-LAST; one seed if there is no LAST.

    Raises:
        ArgumentTypeError: it is neither.
    """
    first, dash, last = text.partition("-")
    try:
        found = range(seed(first), seed(last) if dash else seed(first) + 1)
    except argparse.ArgumentTypeError:
        found = range(0)
    if not found:
        raise argparse.ArgumentTypeError(f"must be FIRST-LAST with FIRST < LAST, such as 0-300, not {text!r}")
    return found


def _search(
    numbers: range, scene_of: "functools.partial[Scene]", jobs: int, only: str, list_file: Path | None
) -> int:
    summary, started_s = Summary(), time.monotonic()
    shown_s = started_s
    for outcome in _outcomes(numbers, functools.partial(run_seed, scene_of=scene_of, only=only), jobs):
        if outcome is None:
            summary.skipped += 1
        else:
            summary.add(outcome)
        now_s = time.monotonic()
        if now_s - shown_s > PROGRESS_S:
            shown_s = now_s
            done = summary.total.runs + summary.skipped
            print(
                f"{done}/{len(numbers)} at {done / (now_s - started_s):.1f}/s:"
                f" {summary.total.violations} violations, {summary.total.contacts} contacts",
                file=sys.stderr,
                flush=True,
            )
    print("\n".join(summary.lines()))
    taken_s = time.monotonic() - started_s
    print(f"{summary.total.runs / taken_s:.1f} scenes/s in {taken_s:.0f} s with {jobs} processes")
    if list_file is not None:
        worst = sorted(outcome.seed for outcome in summary.worst)
        list_file.write_text("".join(f"{seed}\n" for seed in worst))
    return 1 if summary.total.violations or not summary.total.runs else 0


def _outcomes(
    numbers: range, work: "functools.partial[Outcome | None]", jobs: int
) -> Iterator[Outcome | None]:
    if jobs == 1:
        yield from map(work, numbers)
        return
    # The parent ends its workers on Ctrl-C.
    with multiprocessing.get_context("spawn").Pool(
        jobs, signal.signal, (signal.SIGINT, signal.SIG_IGN)
    ) as pool:
        yield from pool.imap_unordered(work, numbers, chunksize=8)


def _replay(scene: Scene, *, verbose: bool, picture: Path | None) -> int:
    moments: list[Moment] = []
    outcome = run(scene, watch=moments.append)
    print(f"seed {scene.seed}: {', '.join(scene.tags)}")
    print(f"hull {scene.hull}")
    for lidar in scene.lidars:
        print(lidar)
    print(f"{scene.base}, odometry scale {scene.odometry_scale}, start {scene.start_m:.3f} m")
    print(
        f"closest {outcome.closest_m:.4f} m at {outcome.closest_s:.2f} s, bound {outcome.bound_m:.3f} m"
        f" -> {'VIOLATED' if outcome.violated else 'kept'}; stops {outcome.stops}"
    )
    if verbose:
        from tests.scenes.drawing import describe  # noqa: PLC0415

        print("\n".join(describe(scene, outcome, moments, AROUND_S)))
    if picture is not None:
        from tests.scenes.drawing import draw  # noqa: PLC0415 (matplotlib is slow to import)

        draw(scene, outcome, moments, picture)
        print(picture)
    return 1 if outcome.violated else 0


if __name__ == "__main__":
    main()
