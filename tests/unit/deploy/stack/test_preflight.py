"""Nothing starts that would fail or be unsafe."""

from pathlib import Path

import pytest

from deploy.stack.bringup import check_configuration
from deploy.stack.errors import DeployError
from deploy.stack.launch import DEFAULT_CONFIG, Launch
from sim.hall import MODELS


def launch(directory: Path, text: str) -> Launch:
    path = directory / "robot.toml"
    path.write_text(text)
    return Launch.read(path, None)


RECTANGLE = '[sim]\nhull = "rectangular"\n[supervisor.footprint]\n'


@pytest.mark.parametrize(
    "text",
    [
        DEFAULT_CONFIG.read_text(),
        RECTANGLE + "corners_m = [[0.3, 0.2], [-0.3, 0.2], [-0.3, -0.2], [0.3, -0.2]]",
        RECTANGLE + "radius_m = 0.361",
        "[supervisor.footprint]\nradius_m = 0.4",
    ],
)
def test_a_footprint_around_the_whole_robot_is_accepted(tmp_path: Path, text: str) -> None:
    check_configuration(launch(tmp_path, text))


@pytest.mark.parametrize(
    ("text", "remedy"),
    [
        ('[sim]\nhull = "rectangular"', "corners_m = [[0.3, 0.2], [-0.3, 0.2], [-0.3, -0.2], [0.3, -0.2]]"),
        (RECTANGLE + "corners_m = [[0.2, 0.3], [-0.2, 0.3], [-0.2, -0.3], [0.2, -0.3]]", "extends beyond"),
        (RECTANGLE + "radius_m = 0.355", "extends beyond"),
        ("[supervisor.footprint]\nradius_m = 0.24", "by 0.01 m, .*set radius_m = 0.25"),
    ],
)
def test_a_robot_that_sticks_out_of_its_footprint_is_refused(tmp_path: Path, text: str, remedy: str) -> None:
    with pytest.raises(DeployError, match=remedy.replace("[", r"\[")):
        check_configuration(launch(tmp_path, text))


def test_a_fault_in_any_section_is_refused_before_anything_starts(tmp_path: Path) -> None:
    for text, key in (
        ("[sim]\npayload_kg = -1.0", "sim.payload_kg"),
        ("[teleop]\nlevel = 6", "teleop.level"),
        ("[supervisor]\ntick_hz = 0.0", "supervisor.tick_hz"),
        ('[sim]\nscene = "attic"', "attic"),
    ):
        with pytest.raises(DeployError, match=key):
            check_configuration(launch(tmp_path, text))


def test_a_scene_is_looked_for_beside_the_configuration(tmp_path: Path) -> None:
    with pytest.raises(DeployError, match=r"mine\.toml"):
        check_configuration(launch(tmp_path, '[sim]\nscene = "mine.toml"'))
    (tmp_path / "mine.toml").write_text((MODELS.parent / "layouts" / "empty.toml").read_text())
    check_configuration(launch(tmp_path, '[sim]\nscene = "mine.toml"'))


def test_without_a_sim_its_scene_and_hull_are_not_checked_but_every_section_is(tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    path.write_text('[supervisor.footprint]\nradius_m = 0.24\n[sim]\nscene = "attic"')
    check_configuration(Launch.read(path, None, with_sim=False))
    path.write_text("[teleop]\nlevel = 6")
    with pytest.raises(DeployError, match=r"teleop\.level"):
        check_configuration(Launch.read(path, None, with_sim=False))


def test_a_missing_python_of_ros_2_is_refused_before_anything_starts(tmp_path: Path) -> None:
    with pytest.raises(DeployError, match="make ros2"):
        check_configuration(launch(tmp_path, '[ros2]\npython = "absent"'))
