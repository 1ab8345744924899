"""The seconds around a stop: the figures, and what is reported of a file that is damaged."""

import json
from dataclasses import fields
from pathlib import Path

import pytest

from faults.trial import Injected
from faults.trial import Sample as CampaignSample
from recordings.incidents import summary as incident_summary
from recordings.incidents.incident import IncidentError
from recordings.incidents.summary import read_incident
from supervisor.blackbox.recorder import BlackBox
from supervisor.law.model import Inputs, Odometry
from supervisor.law.reckoning import Velocity
from tests.unit.supervisor.blackbox.black_boxes import NOON_UTC_S, Drive, WriterAtOnce
from tests.unit.supervisor.law.law_harness import CONFIG, FORWARD, NEUTRAL, SPIN, TICK_S, lost
from wire.messages import SafetyStatus

BRAKING_STEPS = 16


def drive_to(directory: Path) -> tuple[Drive, WriterAtOnce]:
    writer = WriterAtOnce(directory)
    return Drive(BlackBox(CONFIG, writer, window_s=60.0, utc=lambda: NOON_UTC_S)), writer


def roll(drive: Drive, velocity: Velocity) -> None:
    """20 ms with a scan and odometry at their end."""
    arrival_s = drive.now_s + TICK_S
    drive.step(Inputs(scans=(drive.scan(arrival_s),), odometry=Odometry(velocity, arrival_s)))


def brake(drive: Drive, velocity: Velocity, steps: int = BRAKING_STEPS) -> None:
    """The base stands after these steps, and for 0.2 s."""
    for step in range(steps - 1, -10, -1):
        share = max(0.0, step / steps)
        roll(drive, Velocity(velocity.linear_m_s * share, velocity.angular_rad_s * share))


def lost_at(directory: Path, velocity: Velocity = FORWARD, *, after_s: float = 0.0) -> Path:
    """The source is lost while the robot moves at this velocity; it brakes in 0.32 s."""
    drive, writer = drive_to(directory)
    drive.hold(0.3)
    drive.hold(1.0, velocity)
    roll(drive, velocity)
    drive.step(Inputs(liveliness=lost()))
    brake(drive, velocity)
    for _ in range(round(after_s / TICK_S)):
        roll(drive, NEUTRAL)
    drive.box.close()
    return writer.paths[0]


def test_the_figures_are_those_of_the_drive(tmp_path: Path) -> None:
    found = read_incident(lost_at(tmp_path)).to_json()
    assert found["id"] == "20260704T120000.000Z-SOURCE_LOST"
    assert found["utc"] == "2026-07-04T12:00:00.000Z"
    assert found["reasons"][0] == "SOURCE_LOST"
    assert found["stops"][0] == {"time_s": 0.0, "reasons": ["SOURCE_LOST"]}
    assert found["owner"] == "teleop"
    assert found["speed_m_s"] == 0.5
    assert found["angular_rad_s"] == 0.0
    assert found["to_standstill_s"] == pytest.approx(BRAKING_STEPS * TICK_S, abs=TICK_S)
    assert found["distance_m"] == pytest.approx(0.5 * 0.5 * BRAKING_STEPS * TICK_S, abs=0.5 * TICK_S)
    assert found["nearest_m"] == pytest.approx(3.0 - CONFIG.hull.radius_m, abs=0.02)
    assert found["problem"] is None
    json.dumps(found, allow_nan=False)


def test_each_sample_has_the_three_velocities_and_the_reasons(tmp_path: Path) -> None:
    samples = read_incident(lost_at(tmp_path), 0.5).samples
    assert samples[0].time_s == pytest.approx(-0.5, abs=1.01 * TICK_S)
    assert samples[0].mode == "DRIVING"
    assert samples[0].measured is None
    stop = next(sample for sample in samples if sample.time_s == 0.0)
    assert (stop.mode, stop.why, stop.commanded, stop.permitted, stop.measured) == (
        "STOPPED",
        "SOURCE_LOST",
        FORWARD,
        NEUTRAL,
        FORWARD,
    )
    assert samples[-1].to_json()["measured"] == [0.0, 0.0]
    assert samples[0].to_json()["measured"] is None


def test_a_short_time_before_the_stop_does_not_change_the_figures(tmp_path: Path) -> None:
    path = lost_at(tmp_path)
    short, long = read_incident(path, 0.1), read_incident(path, 60.0)
    assert short.to_json() == long.to_json()
    assert len(short.samples) < len(long.samples)


def test_all_names_are_those_of_the_status_and_of_the_campaign(tmp_path: Path) -> None:
    incident = read_incident(lost_at(tmp_path))
    known = (
        {field.name for field in fields(SafetyStatus)}
        | {*Injected.model_fields}
        | {*CampaignSample.model_fields}
    )
    of_a_file = {"id", "file", "utc", "stops", "people", "problem"}
    of_odometry = {"measured", "angular_rad_s"}
    assert incident.to_json().keys() - known == of_a_file | {"angular_rad_s"}
    assert incident.samples[0].to_json().keys() - known == {"measured", "why"}
    assert of_odometry.isdisjoint(known)


def test_a_robot_that_turned_has_no_braking_distance_but_a_turn_rate(tmp_path: Path) -> None:
    found = read_incident(lost_at(tmp_path, SPIN)).to_json()
    assert found["speed_m_s"] == 0.0
    assert found["angular_rad_s"] == 1.0
    assert found["distance_m"] == pytest.approx(0.0, abs=1e-6)
    assert found["to_standstill_s"] == pytest.approx(BRAKING_STEPS * TICK_S, abs=TICK_S)


def test_a_base_without_odometry_has_no_speed(tmp_path: Path) -> None:
    drive, writer = drive_to(tmp_path)
    drive.drive()
    drive.step(Inputs(liveliness=lost()))
    drive.hold(0.5)
    drive.box.close()
    found = read_incident(writer.paths[0]).to_json()
    assert (found["speed_m_s"], found["angular_rad_s"], found["distance_m"]) == (None, None, None)


def test_a_robot_that_does_not_come_to_rest_has_no_stopping_distance(tmp_path: Path) -> None:
    drive, writer = drive_to(tmp_path)
    drive.drive()
    roll(drive, FORWARD)
    drive.step(Inputs(liveliness=lost()))
    for _ in range(20):
        roll(drive, FORWARD)
    drive.box.close()
    found = read_incident(writer.paths[0]).to_json()
    assert (found["speed_m_s"], found["distance_m"]) == (0.5, None)


def test_a_second_stop_has_its_time_and_reasons(tmp_path: Path) -> None:
    drive, writer = drive_to(tmp_path)
    drive.drive()
    roll(drive, FORWARD)
    drive.step(Inputs(liveliness=lost()))
    roll(drive, FORWARD)
    drive.step(Inputs(estop=True))
    brake(drive, FORWARD)
    drive.box.close()
    incident = read_incident(writer.paths[0])
    assert incident.reasons[:2] == ("SOURCE_LOST", "ESTOP")
    assert incident.to_json()["stops"][1]["time_s"] == pytest.approx(2 * TICK_S)
    assert incident.to_json()["id"].endswith("Z-ESTOP")


def test_a_truncated_file_is_read_as_far_as_it_goes(tmp_path: Path) -> None:
    path = lost_at(tmp_path)
    path.write_bytes(path.read_bytes()[:-150])
    incident = read_incident(path)
    assert "is damaged after" in incident.problem
    assert incident.to_json()["reasons"][0] == "SOURCE_LOST"


def test_a_file_that_ends_before_its_stop_has_no_figures(tmp_path: Path) -> None:
    path = lost_at(tmp_path)
    path.write_bytes(path.read_bytes()[:2500])
    found = read_incident(path).to_json()
    assert found["problem"] is not None
    assert (found["owner"], found["speed_m_s"], found["nearest_m"]) == (None, None, None)


def test_a_file_without_a_header_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "20260704T120000.000Z-ESTOP.jsonl.gz"
    path.write_bytes(b"not gzip")
    with pytest.raises(IncidentError, match="is not a black box"):
        read_incident(path)


def test_more_steps_than_fit_into_memory_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(incident_summary, "MAX_STEPS", 10)
    with pytest.raises(IncidentError, match="more than 10 steps"):
        read_incident(lost_at(tmp_path))
