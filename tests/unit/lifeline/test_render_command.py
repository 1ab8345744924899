"""`lifeline render`: the rehearsal, the files, and the errors."""

import itertools
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from deploy.stack.errors import DeployError
from lifeline.render.rehearsal import Operator, Rehearsal
from lifeline.render.render import Wanted, parse_size, render, supervisor_for
from sim.config import Build, Hull
from sim.gl import NoGlError, choose
from sim.overlay import Mode, Shown
from sim.plant import Plant
from tests.gl import has_gl, needs_gl

ROOT = Path(__file__).parents[3]


def at_10_hz(seconds: float) -> list[float]:
    return [number / 10.0 for number in range(round(10.0 * seconds))]


def rehearsed(
    hull: Hull, *, drives: bool = True, seconds: float = 8.0
) -> tuple[Plant, list[Shown], list[float]]:
    """The frames at 10 Hz, and the clearance of the hull in each."""
    plant = Plant("empty", options=Build(hull))
    x_m, y_m, _ = plant.start_pose
    plant.place_pillar(x_m + 2.4, y_m)
    moments, gaps_m = list[Shown](), list[float]()
    for shown in Rehearsal(plant, Operator(drives=drives), supervisor_for(plant)).play(at_10_hz(seconds)):
        moments.append(shown)
        gaps_m.append(plant.clearance_m())
    return plant, moments, gaps_m


@pytest.mark.parametrize("hull", Hull)
def test_a_driven_robot_slows_rests_at_thirty_centimetres_says_why_and_backs_out(hull: Hull) -> None:
    plant, moments, gaps_m = rehearsed(hull)
    modes = [mode for mode, _ in itertools.groupby(shown.mode for shown in moments)]
    assert modes == [Mode.READY, Mode.DRIVING, Mode.LIMITED, Mode.STOPPED, Mode.DRIVING, Mode.READY]
    resting = [number for number, shown in enumerate(moments) if shown.mode is Mode.STOPPED]
    assert {shown.reasons for shown in moments} == {(), ("OBSTACLE",)}
    assert moments[resting[-1]].why == "obstacle too close"
    assert gaps_m[resting[-1]] == pytest.approx(0.30, abs=0.02)
    assert min(gaps_m) > 0.29
    assert gaps_m[-1] > 0.6
    assert plant.collisions == 0
    for shown, gap_m in zip(moments, gaps_m, strict=True):
        assert shown.nearest_m == pytest.approx(gap_m, abs=0.09)


def test_nobody_drives_a_robot_that_is_not_to_be_driven() -> None:
    plant, moments, _ = rehearsed(Hull.ROUND, drives=False, seconds=1.0)
    assert {shown.mode for shown in moments} == {Mode.READY}
    assert math.dist(plant.true_pose, plant.start_pose) < 1e-3


def test_a_rehearsal_is_the_same_each_time() -> None:
    (one, first, _), (other, second, _) = (rehearsed(Hull.ROUND, seconds=3.0) for _ in range(2))
    assert one.true_pose == other.true_pose
    assert [shown[:4] for shown in first] == [shown[:4] for shown in second]


@pytest.mark.long
@needs_gl
def test_a_film_has_its_frames_in_its_size_and_moves(tmp_path: Path) -> None:
    wanted = Wanted(tmp_path / "film.webp", scene="empty", size="160x90", seconds=1.2, fps=5.0, drive=True)
    assert render(wanted).sentence.startswith(f"wrote {wanted.out}: 6 frames of 160x90, 0.")
    with Image.open(wanted.out) as film:
        assert (getattr(film, "n_frames", 1), film.size) == (6, (160, 90))
        first = np.asarray(film.convert("RGB")).astype(int)
        film.seek(5)
        last = np.asarray(film.convert("RGB")).astype(int)
    assert np.abs(last - first).max() > 100
    assert first.std() > 15
    assert [path.name for path in tmp_path.iterdir()] == ["film.webp"]


@pytest.mark.long
@needs_gl
def test_a_picture_shows_the_end_and_needs_no_caption(tmp_path: Path) -> None:
    pictures: list[np.ndarray] = []
    for seconds, caption in ((0.1, False), (2.0, False), (2.0, True)):
        out = tmp_path / f"{seconds}{caption}.png"
        wanted = Wanted(out, "empty", "rectangular", "top", "96x64", seconds, drive=True, caption=caption)
        assert "a picture of 96x64" in render(wanted).sentence
        pictures.append(np.asarray(Image.open(out)))
    assert (pictures[0] != pictures[1]).any()
    assert (pictures[1] != pictures[2]).any()


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"out": "film.avi"}, "ends in none of .png, .webp, .gif, .mp4"),
        ({"out": "nowhere/film.mp4"}, "There is no directory .*nowhere; make it first"),
        ({"size": "1280"}, "--size must be like 1280x720, not '1280'"),
        ({"size": "8x8"}, "16 to 4096 pixels a side"),
        ({"size": "99999x100"}, "16 to 4096 pixels a side"),
        ({"scene": "nowhere"}, "There is no layout named 'nowhere'; there are aisle, empty, warehouse"),
        ({"scene": "nowhere.toml"}, "There is no scene file nowhere.toml"),
        ({"camera": "nobody"}, "There is no camera named 'nobody'; there are follow, corner, top"),
        ({"hull": "square"}, "There is no hull named 'square'; there are round, rectangular"),
        ({"seconds": 0.0}, "--seconds must be from 0.1 to 120, not 0"),
        ({"seconds": math.nan}, "--seconds must be from 0.1 to 120, not nan"),
        ({"fps": 61.0}, "--fps must be from 1 to 60, not 61"),
    ],
)
def test_what_cannot_be_rendered_is_refused_in_one_sentence_and_nothing_is_written(
    tmp_path: Path, changes: dict[str, object], why: str
) -> None:
    if not has_gl():
        pytest.skip("neither EGL nor OSMesa")
    values: dict[str, object] = {"out": "film.webp", "scene": "empty", "size": "64x64"} | changes
    wanted = Wanted(**(values | {"out": tmp_path / str(values["out"])}))  # type: ignore[arg-type]
    with pytest.raises(DeployError, match=why) as refusal:
        render(wanted)
    assert "\n" not in str(refusal.value)
    assert not list(tmp_path.iterdir())


def test_a_size_is_width_by_height() -> None:
    assert parse_size(" 1280x720 ") == (1280, 720)
    for text in ("", "x", "12x", "1.5x2", "-1x2", "1280×720x3", "123456x1"):
        with pytest.raises(DeployError, match="like 1280x720"):
            parse_size(text)


@pytest.mark.parametrize(
    ("arguments", "environment", "why"),
    [
        (("--size", "big"), {}, "--size must be like 1280x720, not 'big'"),
        ((), {"MUJOCO_GL": "osmesa"}, "cannot render on this machine: MUJOCO_GL asks for osmesa"),
    ],
)
def test_the_command_ends_with_code_2_and_one_sentence(
    tmp_path: Path, arguments: tuple[str, ...], environment: dict[str, str], why: str
) -> None:
    if environment:
        try:
            choose(environment)
        except NoGlError:
            pass
        else:
            pytest.skip("this machine has OSMesa")
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "lifeline.cli.app",
            "render",
            "--fresh",
            "--out",
            str(tmp_path / "a.png"),
            *arguments,
        ],
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert done.returncode == 2
    assert done.stderr.startswith(f"lifeline: {why}")
    assert done.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())
