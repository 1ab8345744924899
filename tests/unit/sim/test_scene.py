"""Scenes: layouts, MJCF files with and without a robot, and the error of each invalid one."""

import math
import subprocess
import sys
from pathlib import Path

import pytest

from sim import mj, program
from sim.config import Build, Hull, SceneError, SimSection
from sim.hall import MODELS
from sim.plant import Plant
from sim.scene import build

YARD = """<mujoco><compiler angle="degree"/><default><geom friction="0.4" density="7"/></default><worldbody>
  <geom name="ground" type="plane" size="9 9 1"/>
  {things}
  <site name="robot_start" pos="-1 2 0" euler="0 0 90"/>
</worldbody></mujoco>"""

HALL = """
[hall]
size_m = [8.0, 6.0]
[start]
x_m = -2.0
"""


def _file(tmp_path: Path, text: str, name: str = "yard.xml") -> Path:
    path = tmp_path / name
    path.write_text(text)
    return path


def _yard(tmp_path: Path, things: str = "") -> Path:
    return _file(tmp_path, YARD.format(things=things))


def test_a_world_without_a_robot_gets_ours_at_its_start_facing_its_way(tmp_path: Path) -> None:
    plant = Plant(_yard(tmp_path, '<geom name="crate" type="box" size=".5 .5 .5" pos="-1 5 .5"/>'))
    assert plant.true_pose == pytest.approx((-1.0, 2.0, math.pi / 2))
    assert plant.clearance_m() == pytest.approx(2.5 - 0.25)
    assert plant.scan()[180] == pytest.approx(2.5, abs=1e-5)
    assert plant.size_m is None
    plant.step((0.5, 0.0), 1000)
    way_m = plant.wheel_angles_rad[0] * plant.wheels.radius_m
    assert plant.true_pose.y_m == pytest.approx(2.0 + way_m, abs=0.01)
    plant.step((0.5, 0.0), 2500)
    assert plant.last_contact == "crate"


def test_in_a_world_of_others_the_robot_drives_as_in_ours(tmp_path: Path) -> None:
    yard, hall = Plant(_yard(tmp_path)), Plant("empty")
    for plant in (yard, hall):
        plant.step((1.0, 0.5), 800)
    assert yard.wheel_angles_rad == pytest.approx(hall.wheel_angles_rad, abs=1e-6)
    assert yard.wheel_twist == pytest.approx(hall.wheel_twist, abs=1e-6)


def test_things_of_any_shape_and_things_that_can_be_pushed_are_seen_met_and_kept_away_from(
    tmp_path: Path,
) -> None:
    things = """<geom name="log" type="capsule" size=".2 .5" pos="-1 4 .2" euler="0 90 0"/>
      <geom name="lintel" type="box" size="2 .1 .1" pos="-1 3 1.5"/>
      <body name="toy" pos="-1 0.5 .2"><freejoint/><geom type="box" size=".2 .2 .2" mass="2"/></body>"""
    plant = Plant(_yard(tmp_path, things))
    assert plant.scan()[180] == pytest.approx(1.8, abs=0.03)
    assert plant.clearance_m() == pytest.approx(1.5 - 0.2 - 0.25, abs=1e-3)
    plant.step((-0.5, 0.0), 1800)
    assert plant.last_contact == "toy"
    assert plant.clearance_m() < 0.05
    plant.reset()
    plant.step((0.5, 0.0), 1000)
    assert plant.clearance_m() == pytest.approx(4.0 - 0.2 - plant.true_pose.y_m - 0.25, abs=0.02)
    with pytest.raises(ValueError, match="in the toy"):
        plant.place_pillar(-1.0, 0.5)


def test_a_robot_that_is_in_the_scene_is_used_as_it_is(tmp_path: Path) -> None:
    text = f"""<mujoco><option timestep="0.001" cone="elliptic" impratio="10"/>
      <include file="{MODELS / "robot_rectangular.xml"}"/>
      <worldbody><geom type="plane" size="5 5 1"/></worldbody></mujoco>"""
    plant = Plant(_file(tmp_path, text))
    assert plant.timestep_s == 0.001
    assert plant.outline[3:] == (0.3, 0.2)
    assert plant.clearance_m() == math.inf
    plant.step((0.5, 0.0), 3000)
    assert plant.true_pose.x_m == pytest.approx(1.375, abs=0.02)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("<mujoco/>", "no body named 'robot', and no site named 'robot_start'"),
        ("<mujoco><worl", "XML"),
        ("<mujoco><nonsense/></mujoco>", "nonsense"),
        (
            '<mujoco><worldbody><body name="robot"><freejoint name="robot"/><geom size="1"/></body></worldbody></mujoco>',
            "no joint named 'wheel_left'",
        ),
        (
            '<mujoco><worldbody><body><site name="robot_start"/></body></worldbody></mujoco>',
            "not in the world itself but in a body",
        ),
        (
            YARD.format(things='<geom name="rock" type="box" size="1 1 1" pos="-1 2.5 0"/>'),
            "start, (-1, 2) m, is in rock",
        ),
        (YARD.format(things='<geom name="hull" size="1" pos="5 5 1"/>'), "repeated name 'hull'"),
        (YARD.format(things='<geom type="mesh" mesh="none"/>'), "none"),
    ],
)
def test_an_mjcf_file_that_cannot_be_is_refused_with_one_sentence(
    tmp_path: Path, text: str, why: str
) -> None:
    path = _file(tmp_path, text)
    with pytest.raises(SceneError) as refused:
        Plant(path)
    sentence = str(refused.value)
    assert sentence.startswith(f"the scene {path} is refused: ")
    assert why in sentence
    assert "\n" not in sentence


@pytest.mark.parametrize(
    "hull", ['type="sphere" size=".2" mass="1"', 'type="cylinder" size=".2 .1" pos=".1 0 .2" mass="1"']
)
def test_a_robot_whose_hull_has_no_outline_around_its_middle_is_refused(tmp_path: Path, hull: str) -> None:
    with pytest.raises(SceneError, match="not a cylinder or box in the middle"):
        Plant(_own_robot(tmp_path, hull))


def test_a_payload_needs_a_hull_with_a_mass_of_its_own(tmp_path: Path) -> None:
    path = _own_robot(tmp_path, 'type="cylinder" size=".2 .1" pos="0 0 .2"')
    Plant(path)
    with pytest.raises(SceneError, match="no mass of its own"):
        Plant(path, options=Build(payload_kg=1.0))


def _own_robot(tmp_path: Path, hull: str) -> Path:
    wheels = "".join(
        f"""<body name="wheel_{side}" pos="0 {y} .08"><joint name="wheel_{side}" axis="0 1 0"/>
            <geom name="wheel_{side}" size=".08"/></body>"""
        for side, y in (("left", 0.17), ("right", -0.17))
    )
    text = f"""<mujoco><worldbody><geom type="plane" size="5 5 1"/><body name="robot"><freejoint name="robot"/>
      <geom name="hull" {hull}/><site name="imu"/>{wheels}</body></worldbody>
      <actuator><velocity name="wheel_left" joint="wheel_left"/><velocity name="wheel_right" joint="wheel_right"/></actuator>
      <sensor><contact name="hull_contacts" geom1="hull" data="found"/><gyro name="gyro" site="imu"/>
      <accelerometer name="accelerometer" site="imu"/></sensor></mujoco>"""
    return _file(tmp_path, text)


@pytest.mark.parametrize(
    ("scene", "why"),
    [
        (
            "nowhere",
            "no layout named 'nowhere'; there are aisle, empty, warehouse, and any .toml or .xml file",
        ),
        ("nowhere.toml", "no scene file nowhere.toml"),
        (Path("nowhere.xml"), "no scene file nowhere.xml"),
        (Path("scene.usd"), "neither a layout"),
    ],
)
def test_a_scene_that_is_not_there_is_said_so_with_what_there_is(scene: str | Path, why: str) -> None:
    with pytest.raises(SceneError) as refused:
        build(scene)
    assert why in str(refused.value)


def _racks(x_m: float, y_m: float) -> str:
    return f'[[racks]]\nname = "tall"\nx_m = {x_m}\ny_m = {y_m}\n'


def _walker(*waypoints: tuple[float, float], kind: str = "person") -> str:
    places = ", ".join(f"[{x}, {y}]" for x, y in waypoints)
    return f'[[movers]]\nname = "ann"\nkind = "{kind}"\nspeed_m_s = 1.0\nwaypoints_m = [{places}]\n'


@pytest.mark.parametrize(
    ("things", "why"),
    [
        (_racks(3.0, 0.0), "rack tall 1 at (3, 0) m reaches into or beyond the walls"),
        ("[[barrels]]\nx_m = 0.0\ny_m = 2.8\n", "barrel 1 at (0, 2.8) m reaches into or beyond the walls"),
        (_racks(1.0, 1.0) + "[[pallets]]\nx_m = 1.5\ny_m = 1.2\n", "stands in"),
        (_racks(-1.5, 0.0), "the robot's start, (-2, 0) m, is in rack tall 1"),
        ("[[columns]]\nx_m = -2.0\ny_m = 0.36\n", "is in column 1"),
        (_walker((0.0, 1.0), (4.5, 1.0)), "the path of ann passes through east wall"),
        (_racks(1.0, 1.0) + _walker((-1.0, 1.0), (3.0, 1.0)), "the path of ann passes through rack tall 1"),
        (_walker((0.0, 1.0), (0.0, 2.0), (2.3, 2.0), kind="forklift"), "the path of ann passes through"),
        (_walker((-2.0, 0.3), (2.0, 0.3)), "the path of ann begins where the robot starts"),
        (_walker((0.0, 1.0), (2.0, 1.0)).replace("ann", "robot"), "robot"),
        ("[[barrels]]\nx_m = 0.0\n", "barrels.0.y_m is missing"),
    ],
)
def test_a_layout_with_something_that_has_no_room_is_refused_by_its_name(
    tmp_path: Path, things: str, why: str
) -> None:
    path = _file(tmp_path, HALL + things, "yard.toml")
    with pytest.raises(SceneError) as refused:
        build(path, Build(moving=True))
    assert str(refused.value).startswith(f"the scene {path} is refused: ")
    assert why in str(refused.value)


def test_what_stands_just_beside_has_room(tmp_path: Path) -> None:
    things = _racks(2.65, 0.0) + "[[columns]]\nx_m = -2.0\ny_m = 0.38\n" + _walker((0.0, 1.0), (3.74, 1.0))
    scene = build(_file(tmp_path, HALL + things, "yard.toml"), Build(moving=True))
    assert {thing.name for thing in scene.standing} >= {"rack tall 1", "column 1", "east wall"}
    assert scene.size_m == (8.0, 6.0)


def test_the_way_of_a_mover_is_checked_also_while_nothing_moves(tmp_path: Path) -> None:
    path = _file(tmp_path, HALL + _walker((0.0, 1.0), (4.5, 1.0)), "yard.toml")
    with pytest.raises(SceneError, match="passes through east wall"):
        build(path)


@pytest.mark.parametrize("scene", ["warehouse", "aisle", "empty"])
@pytest.mark.parametrize("hull", list(Hull))
def test_every_layout_takes_every_hull_with_all_that_moves_and_all_that_is_to_be_seen(
    scene: str, hull: Hull
) -> None:
    plain = build(scene, Build(hull=hull))
    full = build(scene, Build(hull=hull, moving=True, scenery=True))
    assert full.standing == plain.standing
    assert {mover.name for mover in full.movers} >= {"forklift"} or scene == "aisle"
    assert not full.odd_geoms
    for mover in full.movers:
        mj.id_of(full.model, "body", mover.name)


def test_the_goods_follow_their_seed(tmp_path: Path) -> None:
    def goods(seed: int) -> bytes:
        path = _file(tmp_path, f"goods_seed = {seed}\n" + HALL + _racks(1.0, 1.5), "yard.toml")
        model = build(path, Build(scenery=True)).model
        return model.geom_size.tobytes()

    assert goods(1) == goods(1)
    assert goods(1) != goods(2)


def test_the_configuration_says_what_is_built_and_people_are_about_by_default() -> None:
    assert SimSection().build() == Build(moving=True)
    section = SimSection(hull="rectangular", payload_kg=3.0, wheel_slip=0.5, moving=False)
    assert section.build(scenery=True) == Build(Hull.RECTANGULAR, 3.0, 0.5, moving=False, scenery=True)


@pytest.mark.parametrize(
    ("options", "why"),
    [
        (["--scene", "nowhere"], "sim: There is no layout named 'nowhere'"),
        (["--payload-kg", "-1"], "sim.payload_kg = -1.0: must be from 0 to 100"),
        (["--hull", "oval"], "sim.hull = 'oval'"),
    ],
)
def test_what_cannot_be_is_refused_before_it_connects(
    options: list[str], why: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["sim", "--no-viewer", *options])
    with pytest.raises(SystemExit, match="2"):
        program.main()
    assert why in capsys.readouterr().err


def test_the_process_refuses_what_cannot_be_without_a_traceback() -> None:
    command = [sys.executable, "-m", "sim", "--no-viewer", "--hull", "oval"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2
    assert "sim.hull = 'oval'" in done.stderr
    assert "Traceback" not in done.stderr
