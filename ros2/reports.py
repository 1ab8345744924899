"""The report of each topic, in plain words (pure)."""

from collections.abc import Sequence

from ros2.config import RosSourceSection
from ros2.diagnostics import Level, Report
from ros2.endpoints import Endpoint, clause, names, wrong_qos, wrong_types
from ros2.presence import Programs
from ros2.ros import BOOL


def source_report(
    section: RosSourceSection, programs: Programs, accepted: int, refused: int, problem: str | None = None
) -> Report:
    """Return the report of a command source.

    Args:
        section: its configuration.
        programs: the programs on its topic.
        accepted: number of its messages that were passed on.
        refused: number of the others.
        problem: why messages of its topic were refused lately; None if none was.
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
) -> Report:
    """Return the report of the robot's command topic.

    Args:
        topic: absolute name.
        type_name: the type that is published.
        others: its publishers in other processes.
        subscriptions: its subscriptions.
        base: state of the base's watchdog.
        own_node: name of this process's node.
    """
    problems = _wrong(
        wrong_types(topic, type_name, subscriptions, "stamped"), wrong_qos(topic, subscriptions)
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
    return _report("cmd_vel", problems, f"{clause(subscriptions, 'listen')} on {topic}", values)


def _wrong(*sentences: str | None) -> list[str]:
    return [sentence for sentence in sentences if sentence is not None]


def _report(name: str, problems: Sequence[str], fine: str, values: Sequence[tuple[str, str]]) -> Report:
    """Return an error with all problems, else what is fine."""
    level = Level.ERROR if problems else Level.OK
    return Report(name, level, "; ".join(problems) or fine, tuple(values))
