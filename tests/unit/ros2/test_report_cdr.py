"""The messages that are written without rclpy, compared with rosbags."""

from hypothesis import given
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_typestore

from ros2.cdr import trigger_reply
from ros2.diagnostics import Level, Report
from ros2.report_cdr import diagnostic_array, diagnostic_status, trigger_response

STORE = get_typestore(Stores.ROS2_JAZZY)
STATUS, ARRAY = "diagnostic_msgs/msg/DiagnosticStatus", "diagnostic_msgs/msg/DiagnosticArray"
TEXTS = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=12)
REPORTS = st.builds(
    Report, TEXTS, st.sampled_from(Level), TEXTS, st.lists(st.tuples(TEXTS, TEXTS), max_size=3).map(tuple)
)


def read(status: object) -> Report:
    assert getattr(status, "hardware_id", None) == "lifeline"
    name: str = getattr(status, "name", "")
    assert name.startswith("lifeline: ")
    return Report(
        name.removeprefix("lifeline: "),
        Level(getattr(status, "level", -1)),
        getattr(status, "message", ""),
        tuple((one.key, one.value) for one in getattr(status, "values", ())),
    )


@given(REPORTS)
def test_a_status_is_what_rosbags_reads(report: Report) -> None:
    payload = diagnostic_status(report)
    assert read(message := STORE.deserialize_cdr(payload, STATUS)) == report
    assert bytes(STORE.serialize_cdr(message, STATUS)) == payload


@given(st.lists(REPORTS, max_size=4), st.integers(0, 2**31 * 10**9 - 1))
def test_an_array_is_what_rosbags_reads(reports: list[Report], time_ns: int) -> None:
    payload = diagnostic_array(reports, time_ns)
    message = STORE.deserialize_cdr(payload, ARRAY)
    stamp = message.header.stamp  # type: ignore[attr-defined]
    assert stamp.sec * 10**9 + stamp.nanosec == time_ns
    assert [read(status) for status in message.status] == reports  # type: ignore[attr-defined]
    assert bytes(STORE.serialize_cdr(message, ARRAY)) == payload


@given(st.booleans(), TEXTS)
def test_the_answer_of_a_service_is_read_back(success: bool, message: str) -> None:  # noqa: FBT001 - given by hypothesis
    assert trigger_reply(trigger_response(success=success, message=message)) == (success, message)


def test_a_zero_byte_in_a_text_does_not_end_it() -> None:
    assert trigger_reply(trigger_response(success=True, message="one\0two")) == (True, "onetwo")
