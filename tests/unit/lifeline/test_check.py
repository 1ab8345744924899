"""`lifeline check`: the permitted motions and the risks of a configuration."""

import json
import math
import os
from functools import cache
from pathlib import Path

import pytest
from typer.testing import CliRunner

from deploy.stack.errors import DeployError
from deploy.stack.launch import DEFAULT_CONFIG
from lifeline.check.check import Report, Stopping, check, examine, stopping
from lifeline.check.motions import MOTIONS, Permitted, View, permitted_motions
from lifeline.cli.app import app
from supervisor.config import SupervisorSection
from supervisor.law.reckoning import STANDSTILL, Velocity
from supervisor.measured import MeasuredSection
from wire.reasons import StopReason

EXAMPLES = {path.stem: path for path in (DEFAULT_CONFIG.parent / "examples").glob("*.toml")}
QUARTER = math.pi / 2


_motions: dict[str, tuple[Permitted, ...]] = {}


@pytest.fixture(autouse=True)
def motions_are_computed_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Keep the motions of each configuration: they take most of the time, and many tests change only its risks."""

    def permitted(config: SupervisorSection, views: tuple[View, ...]) -> tuple[Permitted, ...]:
        key = repr((config.model_dump(exclude={"accepted_risks"}), views))
        if key not in _motions:
            _motions[key] = tuple(permitted_motions(config, views))
        return _motions[key]

    monkeypatch.setattr("lifeline.check.check.permitted_motions", permitted)


@cache
def example(name: str) -> Report:
    return examine(EXAMPLES[name])


def report(directory: Path, text: str) -> Report:
    path = directory / "robot.toml"
    path.write_text(text)
    return examine(path)


def motion(found: Report, name: str) -> Permitted:
    return next(permitted for permitted in found.motions if permitted.motion.name == name)


def lidar(*lines: str) -> str:
    return "\n".join(("[supervisor.lidar]", *lines))


FRONT = lidar(f"view_rad = [{-QUARTER}, {QUARTER}]", "beams = 360", "range_max_m = 12.0", "period_s = 0.05")


# --- the example files


def test_there_is_an_example_for_each_of_the_usual_robots() -> None:
    ros2 = {"turtlebot4", "clearpath", "ros2_diff_drive", "ros2_trial"}
    assert set(EXAMPLES) == {"amr_one_lidar", "amr_two_lidars", *ros2}
    assert {name for name in EXAMPLES if example(name).ros2} == ros2


@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_is_valid_says_all_about_its_lidars_and_may_drive_ahead_at_full_speed(name: str) -> None:
    found = example(name)
    assert [view.assumed for view in found.lidars] == [()] * len(found.lidars)
    ahead = motion(found, "ahead")
    for decision in (ahead.at_rest, ahead.after_driving):
        assert decision.output == Velocity(found.config.max_linear_m_s, 0.0)


@pytest.mark.parametrize("name", ["turtlebot4", "clearpath", "ros2_diff_drive"])
def test_a_ros_2_robot_of_an_example_may_do_everything(name: str) -> None:
    assert all(p.at_rest.scale == p.after_driving.scale == 1.0 for p in example(name).motions)


def test_a_turtlebot_4_sees_all_around_and_may_do_everything() -> None:
    found = example("turtlebot4")
    assert all(p.at_rest.scale == 1.0 and p.after_driving.scale == 1.0 for p in found.motions)
    (lidar,) = found.config.all_lidars()
    assert (found.config.scan_timeout_of(lidar), found.lidars[0].period_s) == (0.45, 0.18)


def test_a_robot_with_one_front_lidar_may_not_back_out_and_says_why() -> None:
    found = example("amr_one_lidar")
    back = motion(found, "back")
    assert back.at_rest.output == STANDSTILL
    assert back.at_rest.reasons == (StopReason.SCAN_BLIND,)


def test_the_two_lidars_of_an_example_look_away_from_each_other_from_opposite_corners() -> None:
    first, second = example("amr_two_lidars").config.all_lidars()
    assert (first.topic, second.topic) == ("scan", "scan_rear")
    assert (first.x_m, first.y_m) == (-second.x_m, -second.y_m)
    assert abs(first.yaw_rad - second.yaw_rad) == pytest.approx(math.pi, abs=1e-5)


def test_a_robot_with_two_diagonal_lidars_may_do_everything_but_with_one_of_them_not(tmp_path: Path) -> None:
    found = example("amr_two_lidars")
    assert all(p.at_rest.scale == 1.0 and p.after_driving.scale == 1.0 for p in found.motions)
    text = EXAMPLES["amr_two_lidars"].read_text()
    first, second = text.rindex("[[supervisor.lidars]]"), text.index("[teleop]")
    alone = report(tmp_path, text[:first] + text[second:])
    assert motion(alone, "back").at_rest.reasons == (StopReason.SCAN_BLIND,)


def test_with_a_memory_of_free_space_the_robot_with_one_lidar_may_back_out_the_way_it_came(
    tmp_path: Path,
) -> None:
    text = EXAMPLES["amr_one_lidar"].read_text()
    found = report(tmp_path, text.replace("unseen_memory_s = 0.0", "unseen_memory_s = 5.0"))
    back = motion(found, "back")
    assert back.at_rest.reasons == (StopReason.SCAN_BLIND,)
    assert back.after_driving.output.linear_m_s < -0.1


# --- the stopping distance


def test_the_stopping_distance_is_reaction_and_braking_and_the_stop_distance(tmp_path: Path) -> None:
    found = report(
        tmp_path,
        "[supervisor]\nmax_linear_m_s = 0.8\ndeceleration_m_s2 = 0.5\nstop_distance_m = 0.25\ntransport_s = 0.04\n"
        + lidar("period_s = 0.1"),
    )
    way = found.stopping
    assert way.reaction_s == pytest.approx(2 * 0.1 + 0.04)
    assert way.reaction_m == pytest.approx(0.8 * 0.24)
    assert way.braking_m == pytest.approx(0.8**2 / (2 * 0.5))
    assert way.total_m == pytest.approx(0.192 + 0.64 + 0.25)


def test_the_stopping_distance_contains_latency_and_dead_time(tmp_path: Path) -> None:
    late = report(
        tmp_path, "[supervisor]\nbase_dead_time_s = 0.1\n[supervisor.lidar]\nlatency_s = 0.05\n[sim]\n"
    )
    assert late.stopping.reaction_s == pytest.approx(report(tmp_path, "[sim]\n").stopping.reaction_s + 0.15)


def test_a_measured_limit_counts_in_the_stopping_distance_where_it_is_worse(tmp_path: Path) -> None:
    def measured(deceleration_m_s2: float, dead_s: float, latency_s: float) -> Stopping:
        def value(limit: float) -> str:
            return f'{{ value = 1.0, limit = {limit}, n = 9, date = "2026-11-26", version = "1", how = "by hand" }}'

        return report(
            tmp_path,
            f"[sim]\n[measured]\ndeceleration_m_s2 = {value(deceleration_m_s2)}\ndead_time_s = {value(dead_s)}\n"
            f"[measured.lidars.lidar]\nlatency_s = {value(latency_s)}\n",
        ).stopping

    configured = report(tmp_path, "[sim]\n").stopping
    assert measured(9.0, 0.0, 0.0) == configured
    worse = measured(0.7, 0.2, 0.3)
    assert worse.braking_m == pytest.approx(worse.speed_m_s**2 / (2 * 0.7))
    assert worse.reaction_s == pytest.approx(configured.reaction_s + 0.2 + 0.3)
    assert worse.total_m > configured.total_m


def test_the_slowest_lidar_decides_how_late_it_reacts(tmp_path: Path) -> None:
    found = report(
        tmp_path,
        '[[supervisor.lidars]]\nname = "a"\ntopic = "scan"\nperiod_s = 0.05\n'
        '[[supervisor.lidars]]\nname = "b"\ntopic = "b"\nperiod_s = 0.15\n',
    )
    assert found.stopping == stopping(found.config, (found.lidars[1],), MeasuredSection())
    assert found.stopping.reaction_s == pytest.approx(0.33)


# --- the narrowest passage, and what the gaps between beams hide


@pytest.mark.parametrize(
    ("hull", "width_m"),
    [("radius_m = 0.25", 1.1), ("corners_m = [[0.5, -0.2], [0.5, 0.3], [-0.5, 0.3], [-0.5, -0.2]]", 1.1)],
)
def test_the_narrowest_passage_has_the_stop_distance_at_both_sides(
    tmp_path: Path, hull: str, width_m: float
) -> None:
    assert report(tmp_path, f"[supervisor.footprint]\n{hull}\n[sim]\n").passage_m == pytest.approx(width_m)
    near = report(tmp_path, f"[supervisor]\nstop_distance_m = 0.2\n[supervisor.footprint]\n{hull}\n[sim]\n")
    assert near.passage_m == pytest.approx(width_m - 0.2)


def test_few_beams_hide_the_smallest_obstacle_from_near_on(tmp_path: Path) -> None:
    text = "[supervisor.lidar]\nbeams = 120\nx_m = 0.1\n"
    (hides,) = report(tmp_path, text).hiding
    half_rad = math.pi / 120
    assert hides.from_m == pytest.approx(0.02 * (1.0 / math.sin(half_rad) - 1.0))
    margin_m, lost_m_s = hides.from_m + 0.1 - 0.25 - 0.30, 1.5 * report(tmp_path, text).stopping.reaction_s
    assert hides.permits_m_s == pytest.approx(math.sqrt(lost_m_s**2 + 3.0 * margin_m) - lost_m_s)
    permitted = motion(report(tmp_path, text), "ahead").at_rest.output.linear_m_s
    assert hides.permits_m_s == pytest.approx(permitted, rel=0.25)


def test_enough_beams_permit_the_top_speed(tmp_path: Path) -> None:
    (hides,) = report(tmp_path, "[sim]\n").hiding
    assert hides.permits_m_s == 1.0


def test_what_beams_and_hull_permit_is_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "robot.toml"
    path.write_text("[supervisor.lidar]\nbeams = 90\n[sim]\n")
    check(path)
    output = capsys.readouterr().out
    assert "The narrowest straight passage is 1.10 m wide: the hull, and 0.3 m at both sides." in output
    assert (
        "lidar: between 90 beams with 4° between them, an obstacle of 0.04 m may hide from 0.55 m on."
        in output
    )
    path.write_text("[sim]\n")
    check(path)
    assert "may hide" not in capsys.readouterr().out
    check(path, as_json=True)
    document = json.loads(capsys.readouterr().out)
    assert (document["passage_m"], document["hiding"][0]["lidar"]) == (1.1, "lidar")


# --- the view of a lidar


def test_a_lidar_upside_down_is_shown_as_such(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "robot.toml"
    path.write_text("[supervisor.lidar]\nflip = true\n[sim]\n")
    check(path)
    assert "upside" in capsys.readouterr().out
    check(path, as_json=True)
    assert json.loads(capsys.readouterr().out)["lidars"][0]["flip"] is True


def test_a_lidars_own_keys_count_before_those_of_the_simulation(tmp_path: Path) -> None:
    sim = "[sim]\nlidar_beams = 180\nlidar_span_rad = 2.0\nlidar_range_max_m = 6.0\nscan_hz = 25.0\n"
    (view,) = report(tmp_path, sim).lidars
    assert view.assumed == ()
    assert (view.beams, view.range_max_m, view.period_s) == (180, 6.0, 0.04)
    assert view.angle_min == -1.0
    assert view.angle_increment == pytest.approx(2.0 / 179)

    own = lidar("view_rad = [-1.5, 0.5]", "beams = 101", "range_max_m = 4.0", "period_s = 0.1")
    (view,) = report(tmp_path, sim + own).lidars
    assert view == (-1.5, pytest.approx(0.02), 101, 4.0, 0.1, ())


def test_what_the_file_does_not_say_is_assumed_and_named(tmp_path: Path) -> None:
    (view,) = report(tmp_path, "").lidars
    assert set(view.assumed) == {"view_rad", "beams", "range_max_m", "period_s"}
    assert view.angle_increment == pytest.approx(math.tau / 360)  # a full turn has as many gaps as beams
    (view,) = report(tmp_path, lidar('profile = "neato_xv"', "view_rad = [-1.0, 1.0]")).lidars
    assert set(view.assumed) == {"beams", "range_max_m"}
    assert view.period_s == 0.2


# --- the motions, by the law


def test_in_open_space_the_default_robot_may_do_everything_at_full_speed() -> None:
    found = examine(DEFAULT_CONFIG)
    assert [permitted.motion for permitted in found.motions] == list(MOTIONS)
    for permitted in found.motions:
        asked = Velocity(permitted.motion.linear * 1.0, permitted.motion.angular * 2.0)
        assert permitted.at_rest.output == permitted.after_driving.output == asked


def test_half_a_view_permits_to_drive_ahead_but_not_back(tmp_path: Path) -> None:
    found = report(tmp_path, FRONT)
    assert motion(found, "ahead").at_rest.scale == 1.0
    assert motion(found, "turn left").at_rest.scale == 1.0  # a round hull sweeps nothing
    assert motion(found, "back").at_rest.reasons == (StopReason.SCAN_BLIND,)


def test_a_creep_into_the_blind_is_what_is_permitted_of_backing_out(tmp_path: Path) -> None:
    found = report(tmp_path, "[supervisor]\nblind_creep_m_s = 0.1\n" + FRONT)
    assert motion(found, "back").at_rest.output.linear_m_s == pytest.approx(-0.1, rel=0.01)


def test_a_lidar_that_does_not_see_far_permits_less_speed(tmp_path: Path) -> None:
    found = report(tmp_path, "[sim]\nlidar_range_max_m = 0.8\n")
    assert 0.0 < motion(found, "ahead").at_rest.output.linear_m_s < 0.9


def test_a_base_without_odometry_is_checked_without(tmp_path: Path) -> None:
    found = report(tmp_path, "[supervisor]\nodometry = false\n")
    assert motion(found, "back").after_driving.scale == 1.0


# --- the risks


def test_the_complete_example_has_no_risk() -> None:
    assert examine(DEFAULT_CONFIG).risks == ()


@pytest.mark.parametrize("endpoint", ["tcp/127.0.0.1:7448", "tcp/localhost:7447", "tls/0.0.0.0:7447"])
def test_an_endpoint_on_this_machine_or_behind_tls_is_no_risk(tmp_path: Path, endpoint: str) -> None:
    plain = report(tmp_path, "").risks
    assert report(tmp_path, f'[bus]\nendpoint = "{endpoint}"\nkeys = "bundle"').risks == plain


@pytest.mark.parametrize(
    ("text", "setting", "risk"),
    [
        ("[supervisor]\ncommand_timeout_s = 0.5", "command_timeout_s = 0.5", "0.50 m after the operator's"),
        (
            '[bus]\nendpoint = "tcp/0.0.0.0:7447"',
            '[bus] endpoint = "tcp/0.0.0.0:7447"',
            "Any client that can connect",
        ),
        ("[supervisor]\nstop_distance_m = 0.2", "stop_distance_m = 0.2", "within 0.2 m of a person"),
        ("[supervisor]\noverrun_s = 0.2", "overrun_s = 0.2", "0.20 m while the supervisor hangs"),
        ("[supervisor]\nodom_timeout_s = 0.4", "odom_timeout_s = 0.4", "0.40 m on the last odometry"),
        (
            "[supervisor]\nbase_timeout_s = 0.3\n[sim]\ncommand_timeout_s = 0.3",
            "[sim] command_timeout_s = 0.3",
            "0.30 m after the supervisor",
        ),
        ("[supervisor]\nscan_timeout_s = 0.5", "timeout of lidar = 0.5", "0.50 m on the last scan"),
        (
            lidar('profile = "own"', "own = { nan_is_free = true }"),
            'profile of lidar = "own"',
            "Readings of NaN count",
        ),
        (lidar('profile = "neato_xv"'), 'profile of lidar = "neato_xv"', "Readings of 0.0, NaN, 0.053 count"),
        (lidar('profile = "hokuyo_urg"'), 'profile of lidar = "hokuyo_urg"', "below 0.0195 m"),
        (
            "[supervisor]\nworks_in_the_open = true",
            "works_in_the_open = true",
            "covered lidar looks like open space, in which the robot drives at up to 0.5 m/s",
        ),
        (
            "[supervisor]\nblind_creep_m_s = 0.05",
            "blind_creep_m_s = 0.05",
            "may touch an obstacle that no beam sees",
        ),
        ("[supervisor]\nunseen_memory_s = 3.0", "unseen_memory_s = 3", "last seen up to 3 s ago"),
        (
            "[supervisor]\nsmallest_obstacle_m = 0.1",
            "smallest_obstacle_m = 0.1",
            "between 0.04 and 0.1 m wide",
        ),
        ("[supervisor]\nodometry = false", "odometry = false", "is not detected"),
        ("[supervisor]\ndeceleration_m_s2 = 1.9", "deceleration_m_s2 = 1.9", "leaves no margin"),
    ],
)
def test_each_setting_that_creates_a_risk_is_named_with_it(
    tmp_path: Path, text: str, setting: str, risk: str
) -> None:
    simulated = text if "[sim]" in text else f"{text}\n[sim]\n"
    found = {entry.setting: entry.sentence for entry in report(tmp_path, simulated).risks}
    assert risk in found.pop(setting)
    assert all(name.startswith("timeout of lidar") for name in found)  # a sensor's profile provides its own


def test_a_profile_that_asks_a_beam_to_prove_that_it_sees_creates_no_risk(tmp_path: Path) -> None:
    found = report(tmp_path, lidar('profile = "sick_lms"') + "\n[sim]\n")
    assert found.risks == ()


REAL = "[supervisor]\ndeceleration_m_s2 = 1.5\n" + FRONT
UNMEASURED = [
    "deceleration_m_s2 = 1.5",
    "base_dead_time_s = 0",
    "base_timeout_s = 0.15",
    "no measured odometry_scale",
    "no measured turn_scale",
    "yaw_rad of lidar = 0",
    "latency_s of lidar = 0",
    "no measured estop_s",
]
"""What must be measured of a real robot."""


def measured(**limits: float) -> str:
    """Return a section `[measured]` with these limits; `lidar_` stands for the lidar's table; an e-stop has none."""

    def line(key: str, limit: float) -> str:
        path = f"lidars.lidar.{key.removeprefix('lidar_')}" if key.startswith("lidar_") else key
        values = f"value = {limit}" if key == "estop_s" else f"value = {limit}, limit = {limit}"
        return f'{path} = {{ {values}, n = 3, date = "2026-11-27", version = "0.1.0", how = "tape" }}'

    return "\n".join(("\n[measured]", *(line(*one) for one in limits.items()), ""))


GOOD: dict[str, float] = {
    "deceleration_m_s2": 1.6,
    "dead_time_s": 0.03,
    "base_timeout_s": 0.14,
    "odometry_scale": 1.02,
    "turn_scale": 0.97,
    "lidar_yaw_rad": 0.01,
    "lidar_latency_s": 0.02,
    "lidar_period_s": 0.05,
    "estop_s": 0.2,
}


def test_a_real_robot_that_was_measured_as_it_is_configured_has_no_risk(tmp_path: Path) -> None:
    assert report(tmp_path, REAL + measured(**GOOD)).risks == ()
    path = tmp_path / "robot.toml"
    assert run(path)[0] == 0


@pytest.mark.parametrize("text", [REAL, REAL + "\n[sim]\n"], ids=["real", "simulated"])
def test_numbers_that_were_measured_just_as_configured_are_no_risk(tmp_path: Path, text: str) -> None:
    edges = {
        "deceleration_m_s2": 1.5,
        "dead_time_s": 0.04,
        "base_timeout_s": 0.15,
        "odometry_scale": 1.049,
        "turn_scale": 0.951,
        "lidar_yaw_rad": -0.05,
        "lidar_latency_s": 0.03,
        "lidar_period_s": 0.055,
    }
    assert report(tmp_path, text + measured(**GOOD | edges)).risks == ()


@pytest.mark.parametrize(
    ("key", "worse", "setting"),
    [
        ("deceleration_m_s2", 1.49, "deceleration_m_s2 = 1.5 (measured: 1.49)"),
        ("dead_time_s", 0.041, "base_dead_time_s = 0 (measured: 0.041)"),
        ("base_timeout_s", 0.16, "base_timeout_s = 0.15 (measured: 0.16)"),
        ("odometry_scale", 1.06, "odometry_scale = 1.06"),
        ("turn_scale", 0.94, "turn_scale = 0.94"),
        ("lidar_yaw_rad", -0.06, "yaw_rad of lidar = 0 (measured: -0.06)"),
        ("lidar_latency_s", 0.031, "latency_s of lidar = 0 (measured: 0.031)"),
        ("lidar_period_s", 0.06, "period_s of lidar = 0.05 (measured: 0.06)"),
        ("lidar_period_s", 0.25, "timeout of lidar = 0.24 (measured: 0.25)"),
    ],
)
def test_a_number_that_was_measured_worse_than_configured_is_a_risk_also_of_a_simulated_robot(
    tmp_path: Path, key: str, worse: float, setting: str
) -> None:
    for text in (REAL, REAL + "\n[sim]\n"):
        risks = report(tmp_path, text + measured(**GOOD | {key: worse})).risks
        assert setting in [risk.setting for risk in risks]


def test_an_accepted_risk_is_shown_and_leaves_the_exit_code_at_0(tmp_path: Path) -> None:
    accepted = f"[supervisor]\naccepted_risks = {UNMEASURED}\ndeceleration_m_s2 = 1.5\n" + FRONT
    found = report(tmp_path, accepted)
    assert found.risks == ()
    assert [risk.setting for risk in found.accepted] == UNMEASURED
    code, output = run(tmp_path / "robot.toml")
    assert code == 0
    assert "All risks are accepted." in output


def test_another_value_or_a_worse_measurement_of_an_accepted_setting_is_a_risk_again(tmp_path: Path) -> None:
    accepted = f"[supervisor]\naccepted_risks = {UNMEASURED}\ndeceleration_m_s2 = 1.6\n" + FRONT
    found = report(tmp_path, accepted)
    assert [risk.setting for risk in found.risks] == ["deceleration_m_s2 = 1.6"]
    assert found.needless == ("deceleration_m_s2 = 1.5",)
    assert run(tmp_path / "robot.toml")[0] == 1
    worse = report(tmp_path, accepted.replace("1.6", "1.5") + measured(deceleration_m_s2=1.0))
    assert [risk.setting for risk in worse.risks] == ["deceleration_m_s2 = 1.5 (measured: 1)"]


def test_a_measured_lidar_that_the_robot_does_not_have_is_refused(tmp_path: Path) -> None:
    with pytest.raises(
        DeployError, match=r"measured\.lidars\.lidar: there is no such lidar in \[supervisor\], only a"
    ):
        report(
            tmp_path,
            '[[supervisor.lidars]]\nname = "a"\ntopic = "scan"\n' + measured(lidar_yaw_rad=0.0),
        )


def test_a_wrong_key_of_measured_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DeployError, match=r"measured\.decel: there is no such key"):
        report(tmp_path, "[measured]\ndecel = 1.0\n")


def test_a_real_base_has_to_be_measured(tmp_path: Path) -> None:
    risks = {risk.setting: risk.sentence for risk in report(tmp_path, REAL).risks}
    assert list(risks) == UNMEASURED
    assert "measure it" in risks["deceleration_m_s2 = 1.5"]


def test_a_real_base_without_a_number_is_slow_until_it_is_measured(tmp_path: Path) -> None:
    risk, *others = report(tmp_path, FRONT).risks
    assert risk.setting == "no deceleration_m_s2"
    assert [other.setting for other in others] == UNMEASURED[1:]
    assert "at most 0.5 m/s" in risk.sentence


# --- ROS 2

ROS2 = """\
[supervisor]
max_linear_m_s = 0.5
[ros2]
namespace = "r7"
discovery_range = "subnet"
command_timeout_s = 0.2
sources = [
  { name = "joy", topic = "joy/cmd_vel", hold_s = 0.6 },
  { name = "path", topic = "/nav/cmd_vel", stamped = true, arm = "on_request" },
]
"""


def test_the_topics_of_ros_2_are_listed_with_absolute_names_types_and_holds(tmp_path: Path) -> None:
    topics = {topic.use: topic for topic in report(tmp_path, ROS2 + FRONT).ros2}
    assert {use: (one.direction, one.topic, one.type) for use, one in topics.items()} == {
        "lidar lidar": ("in", "/r7/scan", "sensor_msgs/msg/LaserScan"),
        "odometry": ("in", "/r7/odom", "nav_msgs/msg/Odometry"),
        "source joy": ("in", "/r7/joy/cmd_vel", "geometry_msgs/msg/Twist"),
        "source path": ("in", "/nav/cmd_vel", "geometry_msgs/msg/TwistStamped"),
        "base": ("out", "/r7/cmd_vel", "geometry_msgs/msg/Twist"),
    }
    assert topics["source joy"].note == (
        "held for 0.6 s: up to 30 cm after the last key press, before it brakes"
    )
    assert topics["source path"].note == "armed by /lifeline/arm after each stop"
    assert topics["base"].note == "zero after 0.2 s without the supervisor"


def test_what_ros_2_settings_risk_is_named(tmp_path: Path) -> None:
    risks = {risk.setting: risk.sentence for risk in report(tmp_path, ROS2 + FRONT).risks}
    assert "DDS has no access control" in risks['[ros2] discovery_range = "subnet"']
    assert "may drive 0.10 m after the supervisor hangs" in risks["[ros2] command_timeout_s = 0.2"]
    assert "up to 30 cm" in risks["hold_s of joy = 0.6"]
    assert "/lifeline/arm" in risks['arm of path = "on_request"']


def test_clocks_that_are_not_compared_are_risks(tmp_path: Path) -> None:
    text = ROS2.replace("[ros2]", '[ros2]\nstamped = true\nstamp = "now"')
    text = text.replace("stamped = true, arm", 'stamped = true, clock = "own", arm')
    risks = {risk.setting: risk.sentence for risk in report(tmp_path, text + FRONT).risks}
    assert "later by the difference" in risks['[ros2] stamp = "now"']
    assert "old by a constant time" in risks['clock of path = "own"']


def test_the_router_of_rmw_zenoh_is_a_risk_and_the_range_of_dds_then_is_none(tmp_path: Path) -> None:
    text = ROS2.replace("[ros2]", '[ros2]\nrmw = "zenoh"')
    risks = {risk.setting: risk.sentence for risk in report(tmp_path, text + FRONT).risks}
    assert (
        "Every program that reaches the router"
        in risks['[ros2] rmw = "zenoh", router = "tcp/127.0.0.1:7448"']
    )
    assert '[ros2] discovery_range = "subnet"' not in risks


def test_the_defaults_of_ros_2_add_no_risk(tmp_path: Path) -> None:
    assert report(tmp_path, "[ros2]\n" + FRONT).risks == report(tmp_path, FRONT).risks


# --- the command


def run(path: Path) -> tuple[int, str]:
    result = CliRunner().invoke(app, ["check", str(path)])
    return result.exit_code, result.output


def test_without_a_risk_the_exit_code_is_0() -> None:
    code, output = run(DEFAULT_CONFIG)
    assert code == 0
    for words in (
        "the configuration is valid",
        "the stopping distance is 0.76 m",
        "turn right",
        "No setting creates",
    ):
        assert words in output


def test_a_required_estop_station_changes_no_motion_and_is_named(tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    plain, stations = FRONT, '\n[[supervisor.estop_stations]]\nname = "door"\n'
    assert report(tmp_path, plain + stations).motions == report(tmp_path, plain).motions
    path.write_text(plain + stations)
    _, output = run(path)
    assert "ESTOP_STATION_LOST" not in output
    assert "Required e-stop stations: door." in output
    path.write_text(f"{plain}{stations}required = false\n")
    assert "Required e-stop" not in run(path)[1]


def test_with_a_risk_the_exit_code_is_1_and_what_is_assumed_is_said(tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    path.write_text(
        "[supervisor]\nworks_in_the_open = true\nbase_timeout_s = 0.3\n[sim]\ncommand_timeout_s = 0.3\n"
    )
    code, output = run(path)
    assert code == 1
    assert "works_in_the_open" in output
    assert "[sim]" in output  # not interpreted as markup of the table
    path.write_text(lidar("view_rad = [-1.5, 1.5]"))
    code, output = run(path)
    assert code == 1
    assert "lidar: assumed period_s, beams, range_max_m" in output
    assert "no: SCAN_BLIND" in output


def test_the_topics_of_ros_2_are_printed_only_with_its_section(tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    path.write_text(ROS2)
    output = run(path)[1]
    assert "ROS 2 topics" in output
    assert "/r7/joy/cmd_vel" in output
    path.write_text(FRONT)
    assert "ROS 2" not in run(path)[1]


def test_what_is_refused_is_listed_whole_with_exit_code_2(tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    path.write_text(
        "[bus]\nlease_s = 1e9\n[supervisor.lidar]\nyaw_rad = 90\n[teleop]\nlevel = 9\n[sim]\nseed = -1\n"
    )
    code, output = run(path)
    assert code == 2
    for key in ("bus.lease_s", "supervisor.lidar.yaw_rad", "teleop.level", "sim.seed"):
        assert f"{key} = " in output


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DeployError, match="cannot read"):
        examine(tmp_path / "absent.toml")


def test_the_exit_codes_are_in_the_help() -> None:
    output = " ".join(CliRunner().invoke(app, ["check", "--help"]).output.split())
    assert "Exit 0 if" in output
    assert "2 if the file is refused" in output


def test_a_file_with_any_name_is_checked(tmp_path: Path) -> None:
    path = tmp_path / os.fsdecode(b"a\xff\x1b.toml")
    path.write_text("[sim]\n")
    result = CliRunner().invoke(app, ["check", str(path)])
    assert result.exit_code == 0
    assert "a??.toml: the configuration is valid" in result.output
