"""The checks of `lifeline doctor`: why a robot does not move, or why the system cannot start. Pure.

Each check is one function from what was observed to findings, in the order in which the report prints them.
"""

import shlex
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, NamedTuple

from deploy.stack import ros2_reports
from deploy.stack.formatting import CHECK_NETWORK, GO_NEUTRAL, mode_name
from deploy.stack.ros2_reports import Level, Report
from lifeline.inspection.nodes import Node, describe
from lifeline.inspection.traffic import Traffic
from supervisor.config import SupervisorSection
from wire import topics
from wire.header_clock import in_words
from wire.messages import SafetyStatus
from wire.reasons import words_of
from wire.text import printable
from wire.topics import ANYONE, Topic

CLOCK_LIMIT_S = 1.0
"""Maximum difference between a message's header and this machine's wall clock."""
MIN_COLUMNS, MIN_LINES = 80, 24


class Verdict(StrEnum):
    """The outcome of a check."""

    OK = "ok"
    NOTE = "note"
    """Information, or the consequence of a problem."""
    PROBLEM = "problem"


class Finding(NamedTuple):
    """One line of the report."""

    check: str
    verdict: Verdict
    what: str
    remedy: str = ""
    """What to do next; empty if nothing is to be done."""


def problem(check: str, what: str, remedy: str = "") -> Finding:
    return Finding(check, Verdict.PROBLEM, what, remedy)


def note(check: str, what: str, remedy: str = "") -> Finding:
    return Finding(check, Verdict.NOTE, what, remedy)


def ok(check: str, what: str) -> Finding:
    return Finding(check, Verdict.OK, what)


@dataclass(frozen=True, slots=True)
class Terminal:
    """The terminal of the operator, if there is one."""

    columns: int
    lines: int
    colours: str
    """The value of COLORTERM or TERM."""
    reports_releases: bool | None
    """Whether it reports key releases; None if it did not answer."""


@dataclass(slots=True)
class Observed:
    """What doctor has observed. A field keeps its default if its observation was not possible."""

    versions: dict[str, str] = field(default_factory=dict[str, str])
    """By package."""
    config_path: str = ""
    config_problem: str = ""
    """Why the configuration is refused."""
    config: SupervisorSection | None = None
    has_sim: bool = True
    """Whether the configuration describes a simulated base."""
    has_ros2: bool = False
    """Whether the base is a ROS 2 robot."""
    ros2_problem: str = ""
    """Why the ROS 2 process cannot be started on this machine."""
    ros2_reports: Sequence[Report] = ()
    state_problem: str = ""
    """Why the state directory cannot be used."""
    is_stale: bool = False
    """Whether the state directory has a record of a stack that does not run."""
    hangs: Sequence[tuple[str, str]] = ()
    """When a program hung and was ended by the kernel, and which one."""
    is_estop_recorded: bool = False
    """Whether an e-stop of an earlier run is latched on disk."""
    estop_pressed_by: str = ""
    """Who pressed it and when; empty if unknown."""
    endpoint: str = ""
    is_connected: bool = False
    refusal: str = ""
    """Why this program is refused, such as its certificate: then nothing is known about the supervisor."""
    silence: str | None = None
    """If nothing answers: why, for an endpoint on another machine; None for one of this machine."""
    port_problem: str = ""
    """If nothing answers: why a supervisor could not listen."""
    silent_pid: int | None = None
    """Of a supervisor that holds the port and does not answer."""
    drive: str = "lifeline teleop"
    """The command that starts teleop for this robot."""
    namespace: str = "robot"
    nodes: Sequence[Node] = ()
    nodes_problem: str = ""
    """Why they are not known."""
    traffic: Traffic = field(default_factory=Traffic)
    known: dict[str, Topic[Any]] = field(default_factory=dict[str, Topic[Any]])
    status: SafetyStatus | None = None
    header_offset_s: dict[str, float] = field(default_factory=dict[str, float])
    """By key: the header's stamp less this machine's wall clock at arrival."""
    terminal: Terminal | None = None


def diagnose(seen: Observed) -> list[Finding]:
    """Return the findings of all checks: one problem for each cause, whose consequences are notes without a remedy."""
    findings = [finding for check in CHECKS for finding in check(seen)]
    causes = {finding.check for finding in findings if finding.verdict is Verdict.PROBLEM}
    return [_explained(finding, causes) for finding in findings]


CONSEQUENCES = {
    "base": ("ODOM_STALE", "SCAN_STALE", "nothing is heard"),
    "command source": ("COMMAND_STALE", "COMMAND_TIMEOUT", "NO_COMMAND", "SOURCE_LOST"),
    "rates": ("ODOM_STALE", "SCAN_STALE"),
    "writers": ("SENSOR_CONFLICT",),
    "e-stop station": ("ESTOP_STATION_LOST",),
}
"""By check: how the findings begin that its problem explains."""


def _explained(finding: Finding, causes: Collection[str]) -> Finding:
    """Return a finding as a note if the problem of another check is its cause."""
    is_explained = finding.verdict is Verdict.PROBLEM and any(
        finding.what.startswith(CONSEQUENCES.get(cause, ())) for cause in causes if cause != finding.check
    )
    return finding._replace(verdict=Verdict.NOTE, remedy="") if is_explained else finding


def _versions(seen: Observed) -> Iterator[Finding]:
    if seen.versions:
        yield ok("packages", ", ".join(f"{name} {version}" for name, version in seen.versions.items()))


def _configuration(seen: Observed) -> Iterator[Finding]:
    if seen.config_problem:
        remedy = "correct the file; `lifeline check FILE` shows what it permits"
        yield problem("configuration", seen.config_problem, remedy)
        return
    yield ok("configuration", seen.config_path)
    if seen.has_ros2:
        yield note(
            "base",
            "nothing here proves that the base stops by itself when the ROS 2 process dies",
            "measure it with `lifeline ros2 check-base`",
        )
    elif not seen.has_sim:
        yield note(
            "base",
            "nothing proves that the base brakes by itself when cmd_vel ends, also behind a bridge",
            "stop the supervisor while the lifted robot drives: the wheels must stop within 0.15 s",
        )


def _state(seen: Observed) -> Iterator[Finding]:
    if seen.state_problem:
        yield problem("state directory", seen.state_problem, "choose another with --state-dir")
    by = seen.estop_pressed_by
    if seen.is_estop_recorded and not seen.is_connected:
        yield note(
            "e-stop",
            f"an e-stop of an earlier run is latched{by and f', {by}'}: the robot starts stopped",
            "press s, then r in teleop to reset it",
        )


def _connection(seen: Observed) -> Iterator[Finding]:
    if seen.is_connected:
        yield ok("supervisor", f"answers at {seen.endpoint}")
    elif seen.refusal:
        yield problem("supervisor", printable(seen.refusal))
    elif seen.silence is not None:
        yield problem("supervisor", seen.silence, CHECK_NETWORK)
    elif seen.silent_pid is not None:
        yield problem(
            "supervisor",
            f"it runs (pid {seen.silent_pid}) but does not answer: it hangs, or a signal has stopped it",
            "restart it: `lifeline down`, then `lifeline up`; under systemd `systemctl restart lifeline-supervisor`",
        )
    elif seen.port_problem:
        yield problem("supervisor", f"does not answer, and {seen.port_problem}")
    else:
        what = f"nothing listens on {seen.endpoint}"
        if seen.is_stale:
            what += ", and an earlier stack has ended without cleaning up"
        yield problem("supervisor", what, "start the robot with `lifeline up`")


def _hangs(seen: Observed) -> Iterator[Finding]:
    last = {program: when for when, program in seen.hangs}
    for program, number in Counter(program for _, program in seen.hangs).items():
        times = "once" if number == 1 else f"{number} times"
        yield note(
            "hangs",
            f"{program} hung {times}, was ended by the kernel and started again, last at {last[program]}",
            "see the end of its log at that time, and the known causes in docs/crash-safety.md",
        )


def _nodes(seen: Observed) -> Iterator[Finding]:
    if not seen.is_connected:
        return
    if seen.nodes_problem:
        yield note("nodes", f"not checked: {seen.nodes_problem}")
        return
    read_by_others = {key for node in seen.nodes if node.session.address for key in node.session.reads}
    named = _named(seen)
    if seen.has_ros2 and topics.ROS2 not in named:
        yield problem(
            "base", "the ROS 2 process does not run", "start it with `lifeline up`, or check its log"
        )
    elif topics.SIM not in named and f"{seen.namespace}/{topics.CMD_VEL.key}" not in read_by_others:
        yield problem(
            "base",
            f"no program reads {seen.namespace}/{topics.CMD_VEL.key}",
            "start the sim, or the bridge to the base",
        )
    sources, present = _sources(seen), _present(seen)
    if present:
        yield ok("command source", f"{', '.join(present)} of {', '.join(sources)}")
    elif sources:
        yield problem("command source", f"none of {', '.join(sources)} runs", f"start one: `{seen.drive}`")
    counts = Counter(node.name for node in seen.nodes if node.is_named)
    for name in sorted(name for name, count in counts.items() if count > 1):
        pids = ", ".join(str(node.pid) for node in seen.nodes if node.name == name)
        yield problem("nodes", f"two programs are {printable(name)} (pid {pids})", "end one of them")


def _named(seen: Observed) -> set[str]:
    return {name for node in seen.nodes if node.is_named for name in node.name.split("+")}


def _sources(seen: Observed) -> list[str]:
    return [] if seen.config is None else [source.name for source in seen.config.sources]


def _present(seen: Observed) -> list[str]:
    """Return the command sources that run."""
    named = _named(seen)
    return [name for name in _sources(seen) if name in named]


def _writers(seen: Observed) -> Iterator[Finding]:
    wrong = 0
    for key, topic in seen.known.items():
        if topic.writer == ANYONE:
            continue
        heard = seen.traffic.keys.get(key)
        writing = [node for node in seen.nodes if key in node.session.writes]
        number = max(len(writing), 0 if heard is None else heard.concurrent())
        if number > 1:
            wrong += 1
            who = "; ".join(printable(describe(node)) for node in writing)
            hidden = number - len(writing)
            who += f"{'; ' if who else ''}{hidden} without a declaration" if hidden else ""
            yield problem(
                "writers", f"{number} programs write {key}: {who}", f"stop all but {_writer(seen, topic)}"
            )
    if seen.is_connected and not wrong:
        yield ok("writers", "no topic has more writers than permitted")
    for key in sorted(set(seen.traffic.foreign(seen.namespace)))[:5]:
        yield note("foreign keys", f"{printable(key)} is written on this network")


def _flood(seen: Observed) -> Iterator[Finding]:
    if seen.traffic.uncounted:
        busiest = max(seen.traffic.keys, key=lambda key: seen.traffic.keys[key].samples, default="")
        yield problem(
            "flood",
            f"{seen.traffic.uncounted} messages arrived too fast to be counted, most of them on {printable(busiest)}; "
            "rates, clocks and status are not checked",
            f"stop the program that writes them: `lifeline topic info {shlex.quote(printable(busiest))}` names it",
        )


def _rates(seen: Observed) -> Iterator[Finding]:
    if not seen.is_connected or seen.config is None or seen.traffic.uncounted:
        return
    limits_s = _limits_s(seen.config, seen.namespace)
    for key, (limit_s, needed) in limits_s.items():
        heard = seen.traffic.keys.get(key)
        if heard is None:
            if needed:
                yield problem("rates", f"nothing is heard on {key}", _start(seen, key))
            continue
        longest_s = heard.gaps.maximum_s
        shown = (
            f"{key}: {heard.rate_hz:.1f} Hz, longest gap {1000 * longest_s:.0f} ms of {1000 * limit_s:.0f}"
        )
        if longest_s > limit_s:
            yield problem("rates", shown, f"each such gap stops the robot: {_start(seen, key)}")
        else:
            yield ok("rates", shown)
        ages = heard.ages
        if heard.is_other_clock:
            yield note("ages", f"{key} comes from another machine: its age cannot be measured here")
        elif ages.number and ages.maximum_s > limit_s:
            yield problem(
                "ages",
                f"{key} is up to {1000 * ages.maximum_s:.0f} ms old at arrival, more than {1000 * limit_s:.0f}",
                "check the load of the sender and of its link",
            )


def _limits_s(config: SupervisorSection, namespace: str) -> dict[str, tuple[float, bool]]:
    """Return by key the timeout [s], and whether the robot also stops if no message has ever arrived."""
    limits: dict[str, tuple[float, bool]] = {}
    for lidar in config.all_lidars():
        limits[f"{namespace}/{lidar.topic}"] = (config.scan_timeout_of(lidar), True)
    if config.odometry:
        limits[f"{namespace}/{topics.ODOM.key}"] = (config.odom_timeout_s, False)
    for source in config.sources:
        limits[f"{namespace}/{topics.source_cmd_vel(source.name).key}"] = (config.command_timeout_s, False)
    return limits


def _start(seen: Observed, key: str) -> str:
    topic = seen.known.get(key)
    writer = "its writer" if topic is None else _writer(seen, topic)
    return f"start {writer}, or check its log"


def _writer(seen: Observed, topic: Topic[Any]) -> str:
    """Return the process that writes a topic of this robot."""
    return topics.ROS2 if seen.has_ros2 and topic.writer == topics.SIM else topic.writer


def _ros2(seen: Observed) -> Iterator[Finding]:
    if seen.ros2_problem:
        yield problem("ros2", printable(seen.ros2_problem))
    verdicts = {Level.OK: Verdict.OK, Level.WARN: Verdict.NOTE, Level.ERROR: Verdict.PROBLEM}
    for report in seen.ros2_reports:
        if report.name != ros2_reports.SUPERVISOR:  # the supervisor itself has reported this
            yield Finding("ros2", verdicts[report.level], f"{report.name}: {report.message}")


def _clocks(seen: Observed) -> Iterator[Finding]:
    if seen.traffic.uncounted:
        return
    for key, offset_s in seen.header_offset_s.items():
        if abs(offset_s) > CLOCK_LIMIT_S:
            yield note(
                "clocks",
                f"the header of {key} is {in_words(offset_s)}",
                "synchronise the clocks with NTP, or let its driver stamp in real time (use_sim_time:=false); the law itself does "
                "not compare clocks, but a base that checks stamps does",
            )
    if seen.header_offset_s and all(abs(one) <= CLOCK_LIMIT_S for one in seen.header_offset_s.values()):
        yield ok("clocks", "the headers agree with this machine's clock")


def _stop(seen: Observed) -> Iterator[Finding]:
    status = seen.status
    if status is None:
        if seen.is_connected and not seen.traffic.uncounted:
            yield problem("status", "the supervisor sends no status", "restart the supervisor")
        return
    mode = mode_name(status)
    neutral = (
        GO_NEUTRAL if _present(seen) or seen.nodes_problem or not _sources(seen) else "start a command source"
    )
    if status.mode != SafetyStatus.STOPPED:
        yield ok("mode", f"{mode}: {_who(status)}")
    causes, latched = status.causes_and_latched()
    for name in causes:
        words = words_of(name)
        detail = f": {status.detail}" if name == causes[0] and status.detail else ""
        what = name if words is None else f"{name}: {words.now.replace('WHO', _who(status))}"
        remedy = "" if words is None else words.step.replace("NEUTRAL", neutral)
        yield problem("stop", printable(f"{what}{detail}"), remedy)
    for name in latched:
        words = words_of(name)
        what = name if words is None else f"{name}: {words.over}"
        yield problem("latched", printable(f"{what}. Over now"), f"{neutral}: it sends zero")
    for source in status.unknown_sources:
        yield problem(
            "unknown source",
            f"commands of {printable(source)} are refused: it is not configured",
            "add it to [supervisor] sources",
        )
    if status.estop_record_problem:
        yield problem("e-stop record", printable(status.estop_record_problem), "free or repair the disk")
    yield from _stations(status)
    if status.rmw_zenoh_nodes:
        yield note(
            "rmw_zenoh",
            printable(
                f"nobody reads the topics of {', '.join(status.rmw_zenoh_nodes)}: they use the keys of rmw_zenoh"
            ),
            "start them with another RMW_IMPLEMENTATION, and set [ros2]; or connect them to their own router",
        )
    if status.alarm:
        yield problem("alarm", "the base moves although zero is commanded", "cut the robot's power")


def _stations(status: SafetyStatus) -> Iterator[Finding]:
    for station in status.estop_stations:
        if station.is_missed:
            verdict = Verdict.PROBLEM if station.required else Verdict.NOTE
            name = printable(station.name)
            start = f"start it with `lifeline estop --name {name}`"
            yield Finding("e-stop station", verdict, f"{name}: {station.words()}", start)


def _who(status: SafetyStatus) -> str:
    return printable(status.owner) or "no source"


def _terminal(seen: Observed) -> Iterator[Finding]:
    terminal = seen.terminal
    if terminal is None:
        return
    size = f"{terminal.columns} x {terminal.lines}"
    if terminal.columns < MIN_COLUMNS or terminal.lines < MIN_LINES:
        yield note(
            "terminal",
            f"{size} is small for the dashboard",
            f"enlarge it to {MIN_COLUMNS} x {MIN_LINES}, or use teleop --plain",
        )
    else:
        yield ok("terminal", f"{size}, {terminal.colours or 'no colours'}")
    if not terminal.reports_releases:
        yield note(
            "key releases",
            "this terminal does not report key releases: --mode hold starts later",
            "use a terminal with the kitty keyboard protocol, such as kitty, foot, Ghostty or WezTerm",
        )
    else:
        yield ok("key releases", "reported")


CHECKS: tuple[Callable[[Observed], Iterator[Finding]], ...] = (
    _versions,
    _configuration,
    _state,
    _connection,
    _hangs,
    _nodes,
    _ros2,
    _writers,
    _flood,
    _rates,
    _clocks,
    _stop,
    _terminal,
)


def is_healthy(findings: Sequence[Finding]) -> bool:
    """Return whether no finding is a problem."""
    return all(finding.verdict is not Verdict.PROBLEM for finding in findings)
