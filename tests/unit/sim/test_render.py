"""Pictures by their pixels: objects are at the right place in the right colour."""

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from docs.generate import draw_warehouse
from sim import gl
from sim.config import Build, Hull
from sim.gl import NoGlError
from sim.overlay import COLOURS, STOP_DISTANCE_M, WARNING_DISTANCE_M, Mode, Shown, in_words, offset_outline
from sim.plant import Plant
from sim.render import FIELD_OF_VIEW_RAD, NAMES, Studio, View, ViewError, camera, captioned, view_of
from sim.video import Pixels
from tests.gl import has_gl, needs_gl
from wire.reasons import StopReason

WIDTH, HEIGHT = 192, 144


def nothing(name: str) -> None:
    """The error of a machine without that library."""


@pytest.fixture(scope="module", params=Hull)
def plant(request: pytest.FixtureRequest) -> Plant:
    """In the empty hall, turned a little."""
    plant = Plant("empty", options=Build(request.param, scenery=True))
    plant.step((0.3, 0.5), 600)
    return plant


@pytest.fixture(scope="module")
def studio(plant: Plant) -> Iterator[Studio]:
    with Studio(plant, WIDTH, HEIGHT, samples=1) as studio:
        yield studio


def above(plant: Plant) -> View:
    """Straight down on the robot, 2 m across."""
    x_m, y_m, _ = plant.true_pose
    return View((x_m, y_m, 0.0), 1.0 / math.tan(0.5 * FIELD_OF_VIEW_RAD), 90.0, -90.0)


def pixel_at(
    picture: Pixels, view: View, plant: Plant, own_m: tuple[float, float, float]
) -> NDArray[np.uint8]:
    """The pixel in which a point of the robot's frame is seen from above."""
    _, _, yaw_rad = plant.true_pose
    x_m = own_m[0] * math.cos(yaw_rad) - own_m[1] * math.sin(yaw_rad)
    y_m = own_m[0] * math.sin(yaw_rad) + own_m[1] * math.cos(yaw_rad)
    scale = 0.5 * HEIGHT / math.tan(0.5 * FIELD_OF_VIEW_RAD) / (view.distance_m - own_m[2])
    return picture[int(0.5 * HEIGHT - scale * y_m), int(0.5 * WIDTH + scale * x_m)]


def is_of(colour: tuple[float, float, float], pixel: NDArray[np.uint8]) -> bool:
    """Return the saturated pixels of this hue."""
    wanted, seen = np.array(colour), pixel.astype(np.float64)
    return bool(seen.max() > 100 and np.abs(seen / max(seen.max(), 1.0) - wanted / wanted.max()).max() < 0.25)


@needs_gl
def test_the_robot_is_orange_at_its_edge_and_light_on_its_deck(plant: Plant, studio: Studio) -> None:
    view = above(plant)
    picture = studio.picture(view)
    edge_m = 0.232 if plant.hull_radius_m < 0.3 else 0.284
    assert is_of((0.95, 0.42, 0.08), pixel_at(picture, view, plant, (-edge_m, 0.0, 0.26)))
    assert pixel_at(picture, view, plant, (-0.1, 0.1, 0.266)).min() > 200
    assert np.ptp(pixel_at(picture, view, plant, (0.0, -0.8, 0.0)).astype(int)) < 30  # the floor is grey


@needs_gl
@pytest.mark.parametrize("mode", Mode)
def test_the_stop_ring_is_where_it_belongs_in_the_mode_s_colour(
    plant: Plant, studio: Studio, mode: Mode
) -> None:
    view = above(plant)
    bare, drawn = studio.picture(view), studio.picture(view, Shown(mode))
    for distance_m in (STOP_DISTANCE_M, WARNING_DISTANCE_M):
        ring_m = offset_outline(plant.outline, distance_m)
        if distance_m > STOP_DISTANCE_M:
            ring_m = ring_m[(np.abs(ring_m) < 0.9).all(axis=1)]
        # The middle of each piece; a thin ring may fall between two pixels.
        middles_m = 0.5 * (ring_m + np.roll(ring_m, -1, axis=0))[:-1]
        places_m = [(float(x_m), float(y_m), 0.004) for x_m, y_m in middles_m]
        lit = [is_of(COLOURS[mode], pixel_at(drawn, view, plant, place_m)) for place_m in places_m]
        assert sum(lit) > (0.9 if distance_m == STOP_DISTANCE_M else 0.4) * len(lit)
        if mode is not Mode.ALONE:  # grey is what the floor is
            assert not any(is_of(COLOURS[mode], pixel_at(bare, view, plant, place_m)) for place_m in places_m)


@needs_gl
def test_a_point_lies_where_the_lidar_meets_something() -> None:
    plant = Plant("empty", options=Build(scenery=True))
    x_m, y_m, _ = plant.true_pose
    plant.place_pillar(x_m + 0.9, y_m)
    view = above(plant)
    with Studio(plant, WIDTH, HEIGHT, samples=1) as studio:
        blind = studio.picture(view, Shown(Mode.READY))
        seeing = studio.picture(view, Shown(Mode.READY, ranges=(plant.scan(),)))
    changed = (blind != seeing).any(axis=2)
    changed[:, : WIDTH // 2] = False  # the wall behind, and its points mirrored by the floor
    rows, columns = np.nonzero(changed)
    assert 3 < len(rows) < 400
    assert (np.abs(rows - HEIGHT // 2) < 8).all()
    assert (columns > WIDTH // 2 + 40).all()
    assert any(is_of((0.2, 0.95, 1.0), seeing[place]) for place in zip(rows, columns, strict=True))


@pytest.mark.long
@needs_gl
def test_the_same_moment_makes_the_same_pixels_and_another_moment_others() -> None:
    pictures: list[Pixels] = []
    for moments in ((300,), (300, 100)):
        plant = Plant(options=Build(moving=True, scenery=True))
        with Studio(plant, WIDTH, HEIGHT, samples=1) as studio:
            for steps in moments:
                plant.step((0.5, 0.2), steps)
                shown = Shown(Mode.DRIVING, ranges=(plant.scan(),))
                pictures += [studio.picture(view_of(plant, "follow", 4 / 3), shown) for _ in range(2)]
    first, *others = pictures
    assert [bool((first == other).all()) for other in others] == [True, True, True, False, False]


@needs_gl
@pytest.mark.parametrize("scene", ["warehouse", "empty"])
def test_every_view_shows_the_robot_in_every_layout(scene: str) -> None:
    plant = Plant(scene, options=Build(scenery=True))
    with Studio(plant, WIDTH, HEIGHT, samples=1) as studio:
        for name in NAMES:
            picture = studio.picture(view_of(plant, name, WIDTH / HEIGHT), Shown(Mode.STOPPED))
            red = (picture[:, :, 0] > 150) & (picture[:, :, 1:].max(axis=2) < 120)
            assert np.count_nonzero(red) > 5, name
            assert picture.std() > 15


@needs_gl
def test_a_camera_of_the_scene_s_own_can_be_asked_for(tmp_path: Path) -> None:
    scene = tmp_path / "scene.xml"
    scene.write_text(
        '<mujoco><worldbody><light pos="0 0 4"/><geom type="plane" size="5 5 1" rgba="0.1 0.2 0.9 1"/>'
        '<site name="robot_start"/><camera name="down" pos="2 0 1"/></worldbody></mujoco>'
    )
    plant = Plant(scene)
    assert view_of(plant, "down", 1.0) == "down"
    with Studio(plant, 32, 32, samples=1) as studio:
        red, green, blue = studio.picture("down")[16, 16].tolist()
        assert blue > 150 > green > red
        above = view_of(plant, "top", 1.0)
        red = studio.picture(above, Shown(Mode.STOPPED))[:, :, 0]
    assert isinstance(above, View)
    assert above.distance_m < 10.0  # of the things, not of the pillar that waits 100 m below them
    assert red.max() > 150
    with pytest.raises(ViewError, match=r"no camera named 'up'; there are follow, corner, top, down"):
        view_of(plant, "up", 1.0)


def test_a_view_that_follows_goes_along_but_does_not_turn() -> None:
    plant = Plant("empty")
    view = view_of(plant, "follow", 1.0)
    assert isinstance(view, View)
    before = camera(plant, view)
    plant.step((0.5, 0.0), 1000)
    plant.step((0.0, 1.0), 500)
    after = camera(plant, view)
    assert after.lookat[0] - before.lookat[0] == pytest.approx(
        plant.true_pose.x_m - plant.start_pose.x_m, abs=1e-6
    )
    assert after.azimuth == before.azimuth


def test_a_caption_shows_the_mode_s_colour_and_leaves_the_rest_of_the_picture_alone() -> None:
    pixels = np.full((360, 640, 3), 90, np.uint8)
    stopped = captioned(pixels, Shown(Mode.STOPPED, ("OBSTACLE",), 0.0, 0.3))
    limited = captioned(pixels, Shown(Mode.LIMITED, (), 0.4, 0.45))
    assert (pixels == 90).all()
    for picture, mode in ((stopped, Mode.STOPPED), (limited, Mode.LIMITED)):
        assert (picture[:290] == 90).all()
        assert any(is_of(COLOURS[mode], pixel) for pixel in picture[330, 14:60])
    assert np.count_nonzero((stopped != 90).any(axis=2)) > np.count_nonzero((limited != 90).any(axis=2))


def test_a_narrow_picture_keeps_the_mode_and_lets_the_words_go() -> None:
    pixels = np.zeros((64, 96, 3), np.uint8)
    picture = captioned(pixels, Shown(Mode.STOPPED, ("OBSTACLE", "SCAN_STALE")))
    assert picture.shape == pixels.shape
    assert (picture != 0).any()


def test_reasons_are_reported_in_words_and_nothing_that_comes_from_the_network_is_drawn_as_it_is() -> None:
    assert in_words(("OBSTACLE", "SOURCE_LOST")) == "obstacle too close, command source lost"
    assert in_words(("SOME_NEW_REASON",)) == "some new reason"
    assert in_words(("é" * 500,)) == "?" * 120
    assert (Mode.of(2), Mode.of(17)) == (Mode.DRIVING, Mode.STOPPED)
    shown = Shown(speed_m_s=-0.001)
    assert (shown.speed, shown.nearest, shown.why) == ("0.00 m/s", "-", "")


@pytest.mark.parametrize("reason", StopReason)
def test_every_stop_reason_of_the_law_has_words_of_its_own(reason: StopReason) -> None:
    assert in_words((reason.value,)) != reason.value.lower().replace("_", " ")


@pytest.mark.parametrize("asked", ["", "egl", "EGL"])
@needs_gl
def test_egl_is_taken_where_it_works(asked: str) -> None:
    if gl.choose({}) == "egl":
        assert gl.choose({"MUJOCO_GL": asked}) == "egl"


def test_what_mujoco_gl_asks_for_and_is_not_there_is_refused_with_what_to_do(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(gl.ctypes.util, "find_library", nothing)
    with pytest.raises(NoGlError, match=r"asks for osmesa.*apt install libegl1"):
        gl.choose({"MUJOCO_GL": "osmesa"})
    with pytest.raises(NoGlError, match=r"neither EGL nor OSMesa.*apt install libegl1"):
        gl.choose({})
    assert gl.choose({"MUJOCO_GL": "glfw"}) == "glfw"


def test_without_gl_the_command_says_so_in_one_sentence_and_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(gl.ctypes.util, "find_library", nothing)
    monkeypatch.setenv("MUJOCO_GL", "egl")
    assert draw_warehouse.main(["--out", str(tmp_path / "picture.png")]) == 1
    said = capsys.readouterr().err
    assert said.startswith("The warehouse cannot be drawn here: MUJOCO_GL asks for egl")
    assert said.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_a_picture_of_no_known_kind_is_refused_before_it_is_drawn(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if not has_gl():
        pytest.skip("neither EGL nor OSMesa")
    assert draw_warehouse.main(["--out", str(tmp_path / "picture.bmp")]) == 2
    assert "ends in none of .png, .webp, .gif, .mp4." in capsys.readouterr().err


@needs_gl
def test_the_picture_of_the_readme_shows_hall_robot_ring_person_and_forklift(tmp_path: Path) -> None:
    out = tmp_path / "warehouse.png"
    assert draw_warehouse.main(["--out", str(out), "--width", "320", "--height", "180"]) == 0
    with Image.open(out) as image:
        picture = np.asarray(image.convert("RGB")).astype(int)
    assert picture.shape == (180, 320, 3)
    red, green, blue = picture[:, :, 0], picture[:, :, 1], picture[:, :, 2]
    parts = {
        "the ring": (green > 150) & (red < 110) & (blue < 170),
        "orange: robot, vests, beams": (red > 180) & (green < 140) & (blue < 60),
        "blue uprights": (blue > 90) & (red < 50) & (green < 90),
        "yellow lines": (red > 220) & (green > 180) & (blue < 90),
        "the lidar's points": (red < 140) & (green > 200) & (blue > 200),
        "the forklift's mast and roof": (picture.max(axis=2) < 45) & (np.arange(320) > 260),
        "the person's helmet": (picture.min(axis=2) > 225) & (np.arange(320) > 230),
    }
    for part, mask in parts.items():
        assert np.count_nonzero(mask) > 8, part
