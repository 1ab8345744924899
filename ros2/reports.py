"""What the ROS 2 process reports, in plain words: one report for each topic, and one for the supervisor (pure).

Reports are written as CDR without rclpy; tests/unit/ros2/test_diagnostics.py compares each message with rosbags.
"""

from collections.abc import Sequence

from ros2.config import RosSourceSection
from ros2.presence import Programs
from ros2.ros import BOOL, Endpoint, Level, Report
from ros2.status import Status
from wire.cdr import Writer

HARDWARE_ID = "lifeline"
MOST_NAMES = 4


def supervisor_report(status: Status | None, base: str) -> Report:
    """Return the report of the robot's mode.

    Args:
        status: the supervisor's newest status; None if it is silent.
        base: state of the base's watchdog in this process.
    """
    if status is None:
        return Report(
            "supervisor", Level.ERROR, "the supervisor is silent: the robot is stopped", (("base", base),)
        )
    level = Level.OK
    if status.alarm:
        level = Level.ERROR
    elif status.mode == "STOPPED" or status.warning:
        level = Level.WARN
    why = f" ({', '.join(status.reasons)})" if status.reasons else ""
    values = (
        ("mode", status.mode),
        ("reasons", " ".join(status.reasons)),
        ("owner", status.owner),
        ("nearest_m", f"{status.nearest_m:.3f}"),
        ("requested", f"{status.requested.linear_m_s:.3f} m/s {status.requested.angular_rad_s:.3f} rad/s"),
        ("permitted", f"{status.permitted.linear_m_s:.3f} m/s {status.permitted.angular_rad_s:.3f} rad/s"),
        ("base", base),
    )
    return Report("supervisor", level, f"{status.mode}{why}", values)


def source_report(
    section: RosSourceSection,
    programs: Programs,
    accepted: int,
    refused: int,
    problem: str | None = None,
    *,
    age: str = "",
) -> Report:
    """Return the report of a command source.

    Args:
        section: its configuration.
        programs: the programs on its topic.
        accepted: number of its messages that were passed on.
        refused: number of the others.
        problem: why messages of its topic were refused lately; None if none was.
        age: of a stamped source, what shows the age of its commands.
    """
    topic, live = programs.topic, programs.live
    problems: list[str] = []
    if len(live) > 1:
        problems.append(f"{names(live)} all publish on {topic}, so none is obeyed: end all but one")
    if programs.stopped:
        problems.append(f"the process of {names(live)} is stopped by a signal: continue or end it")
    if programs.outlived:
        problems.append(
            f"{clause(programs.outlived, 'publish')} on {topic} although its `lifeline ros2 exec` has ended, so it is not "
            "obeyed: end it if it still runs"
        )
    problems += _wrong(
        wrong_types(topic, programs.type_name, programs.everyone, f"stamped of the source {section.name}"),
        problem,
    )
    name = f"source {section.name}"
    if not live and not problems:
        return Report(name, Level.WARN, f"no program publishes on {topic}")
    guards = _guards(programs)
    hold = "" if section.hold_s is None else f"; each command is held for {section.hold_s:g} s"
    return _report(
        name,
        problems,
        f"{names(live)} on {topic}, guarded by {guards}{hold}",
        [
            ("topic", f"{topic} ({programs.type_name})"),
            ("node", names(live)),
            ("guards", guards),
            ("hold_s", "off" if section.hold_s is None else f"{section.hold_s:g}"),
            ("arm", section.arm),
            *([("age", age)] if age else []),
            ("accepted", str(accepted)),
            ("refused", str(refused)),
        ],
    )


def _guards(programs: Programs) -> str:
    """Return what detects the program's end, the earliest first."""
    guards = [f"process {programs.pid} on this host"] if programs.pid is not None else []
    guards += ["lifeline ros2 exec"] if programs.wrapped else []
    return ", ".join([*guards, programs.discovery, "the command timeout"])


def sensor_report(
    name: str,
    topic: str,
    type_name: str,
    publishers: Sequence[Endpoint],
    *,
    writers: int,
    problem: str | None = None,
) -> Report:
    """Return the report of a sensor's topic.

    Args:
        name: name of the report.
        topic: absolute name.
        type_name: the expected type.
        publishers: all publishers of the topic.
        writers: number of writers that were heard lately.
        problem: why messages of the topic were refused lately; None if none was.
    """
    problems = _wrong(wrong_types(topic, type_name, publishers, ""), problem)
    if not publishers:
        problems.append(f"no node publishes on {topic}: start the driver, or correct the topic in [ros2]")
    elif writers > 1:
        problems.append(f"{writers} writers publish on {topic} ({names(publishers)}): end all but one")
    elif not problems and not writers:
        problems.append(f"{clause(publishers, 'publish')} nothing on {topic}")
    return _report(name, problems, f"{names(publishers)} on {topic}", [("topic", f"{topic} ({type_name})")])


def estop_report(topic: str, publishers: Sequence[Endpoint]) -> Report:
    """Return the report of the e-stop's topic, on which no button is necessary."""
    problems = _wrong(wrong_types(topic, BOOL, publishers, ""))
    fine = f"{names(publishers)} on {topic}" if publishers else f"no button publishes on {topic}"
    return _report("estop", problems, fine, [("topic", f"{topic} ({BOOL})")])


def base_report(
    topic: str,
    type_name: str,
    others: Sequence[Endpoint],
    subscriptions: Sequence[Endpoint],
    base: str,
    *,
    own_node: str,
    clock: str = "",
    clock_problem: str | None = None,
) -> Report:
    """Return the report of the robot's command topic.

    Args:
        topic: absolute name.
        type_name: the type that is published.
        others: its publishers in other processes.
        subscriptions: its subscriptions.
        base: state of the base's watchdog.
        own_node: name of this process's node.
        clock: of a base with stamped commands, how its clock differs from this computer's.
        clock_problem: why its commands cannot be stamped as it expects; None if they can.
    """
    problems = _wrong(
        wrong_types(topic, type_name, subscriptions, "stamped"),
        wrong_qos(topic, subscriptions),
        clock_problem,
    )
    foreign = [other for other in others if other.node != own_node]
    if foreign:
        problems.insert(
            0,
            f"{clause(foreign, 'publish')} on {topic} too, bypassing the supervisor, so the robot may move although "
            "Lifeline commands zero: end it, or remap it to the topic of a source",
        )
    if len(foreign) < len(others):
        problems.insert(0, f"a second process ros2 of Lifeline publishes on {topic}: end one of the two")
    if not subscriptions:
        problems.append(f"no node listens on {topic}: start the base's driver, or correct cmd_vel in [ros2]")
    values = [("topic", f"{topic} ({type_name})"), ("base", base)]
    if clock:
        values.append(("clock", clock))
    return _report("cmd_vel", problems, f"{clause(subscriptions, 'listen')} on {topic}", values)


def _wrong(*sentences: str | None) -> list[str]:
    return [sentence for sentence in sentences if sentence is not None]


def _report(name: str, problems: Sequence[str], fine: str, values: Sequence[tuple[str, str]]) -> Report:
    """Return an error with all problems, else what is fine."""
    level = Level.ERROR if problems else Level.OK
    return Report(name, level, "; ".join(problems) or fine, tuple(values))


# --- sentences


def names(endpoints: Sequence[Endpoint]) -> str:
    """Return the names of the nodes, as in "/a and /b"; of many, the first ones and how many more endpoints there are."""
    nodes = sorted(endpoint.node for endpoint in endpoints)
    if len(nodes) > MOST_NAMES:
        nodes[MOST_NAMES:] = [f"{len(nodes) - MOST_NAMES} more"]
    return " and ".join(nodes) or "none"


def clause(endpoints: Sequence[Endpoint], verb: str) -> str:
    """Return subject and verb, as in "/a listens" and "/a and /b listen"."""
    ending = "" if len(endpoints) > 1 else "es" if verb.endswith("sh") else "s"
    return f"{names(endpoints)} {verb}{ending}"


def wrong_types(topic: str, expected: str, endpoints: Sequence[Endpoint], option: str) -> str | None:
    """Return a sentence if an endpoint of a topic has another type, which DDS does not connect; None if none has.

    Args:
        topic: absolute name.
        expected: the type that the configuration names.
        endpoints: the publishers, or the subscriptions, of the topic.
        option: the key of `[ros2]` that selects Twist or TwistStamped; empty if there is no choice.
    """
    wrong = [e for e in endpoints if e.type_name != expected]
    if not wrong:
        return None
    kind = wrong[0].type_name
    advice = f"give it a topic with {expected}"
    if option and kind.removesuffix("Stamped") == expected.removesuffix("Stamped"):
        advice = f"set {option} = {'true' if kind.endswith('Stamped') else 'false'}"
    return f"{clause(wrong, 'use')} {kind} on {topic}, but {expected} is expected, so they are not connected: {advice}"


def wrong_qos(topic: str, subscriptions: Sequence[Endpoint]) -> str | None:
    """Return a sentence if a subscription requests more than our publisher offers (reliable, volatile); None if none does."""
    wrong = [s for s in subscriptions if s.is_transient]
    if not wrong:
        return None
    return (
        f"{clause(wrong, 'request')} {topic} with durability transient local, which would also deliver an old command, "
        "so they are not connected: set its durability to volatile"
    )


def diagnostic_status(report: Report) -> bytes:
    """Return the payload of a `diagnostic_msgs/msg/DiagnosticStatus`."""
    writer = Writer()
    _write(writer, report)
    return writer.payload()


def diagnostic_array(reports: Sequence[Report], time_ns: int) -> bytes:
    """Return the payload of a `diagnostic_msgs/msg/DiagnosticArray` with one status for each report.

    Args:
        reports: the reports.
        time_ns: the stamp of its header, by the wall clock.
    """
    writer = Writer()
    writer.header(time_ns)
    writer.value("I", len(reports))
    for report in reports:
        _write(writer, report)
    return writer.payload()


def _write(writer: Writer, report: Report) -> None:
    writer.value("B", report.level)
    writer.text(f"lifeline: {report.name}")
    writer.text(report.message)
    writer.text(HARDWARE_ID)
    writer.value("I", len(report.values))
    for key, value in report.values:
        writer.text(key)
        writer.text(value)
