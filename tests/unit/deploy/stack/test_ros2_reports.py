"""The reports of the ROS 2 process: only its own, printable and bounded."""

from deploy.stack.ros2_reports import MAX_REPORTS, MAX_TEXT, MAX_VALUES, Level, Report, reports_of
from wire.messages import DiagnosticArray, DiagnosticStatus, KeyValue, header


def array(*statuses: DiagnosticStatus) -> DiagnosticArray:
    return DiagnosticArray(header(""), list(statuses))


def status(name: str, level: int = 0, message: str = "", **values: str) -> DiagnosticStatus:
    return DiagnosticStatus(level, name, message, "lifeline", [KeyValue(k, v) for k, v in values.items()])


def test_a_report_has_the_name_of_its_topic_its_level_and_its_values() -> None:
    found = reports_of(array(status("lifeline: source joy", 1, "no program", hold_s="0.6")))
    assert found == (Report("source joy", Level.WARN, "no program", {"hold_s": "0.6"}),)
    assert found[0]._asdict() == {
        "name": "source joy",
        "level": "warn",
        "message": "no program",
        "values": {"hold_s": "0.6"},
    }


def test_levels_that_are_not_known_are_errors() -> None:
    levels = [report.level for report in reports_of(array(*(status("lifeline: x", n) for n in range(4))))]
    assert levels == [Level.OK, Level.WARN, Level.ERROR, Level.ERROR]


def test_the_statuses_of_another_process_are_no_reports() -> None:
    assert reports_of(array(status("sim: base"), status("other"))) == ()
    assert [one.name for one in reports_of(array(status("sim: base"), status("lifeline: odom")))] == ["odom"]


def test_foreign_text_is_printable_and_bounded() -> None:
    values = {f"key {number}\n": "\x1b" * 1000 for number in range(100)}
    hostile = status("lifeline: \x1b[2J" + "n" * 1000, 0, "m" * 1000, **values)
    found = reports_of(array(*[hostile] * 100))
    assert len(found) == MAX_REPORTS
    (report, *_) = found
    texts = [report.name, report.message, *report.values, *report.values.values()]
    assert len(report.values) == MAX_VALUES
    assert all(text.isprintable() and len(text) <= MAX_TEXT for text in texts)
    assert report.message.endswith("…")
    (exact,) = reports_of(array(status("lifeline: x", 0, "m" * MAX_TEXT)))
    assert exact.message == "m" * MAX_TEXT
