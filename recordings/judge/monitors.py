"""Monitors: rules about the past that must hold at every moment of a recording. Pure, and independent of the law.

Each monitor is a past-time formula over a stream of events. It keeps a few times and no history, and it imports nothing of
`supervisor`: a mistake of the law is not repeated here. What happened before the first event is unknown and breaks no rule.
The events of one moment have this order: requests and e-stops, the step of the supervisor, a reset.
"""

import math
from dataclasses import dataclass, field, replace
from typing import ClassVar, NamedTuple

from wire.reasons import Limit, StopReason

ROUNDING_S = 1e-6
MAX_VIOLATIONS = 20
"""Violations of one rule that are kept; more are counted."""
GRACE_S = 0.3
"""Delay of odometry, and rocking wheels, after a base has braked."""

LIMITS = frozenset(limit.value for limit in Limit)
BARRIER = frozenset({StopReason.OBSTACLE.value, StopReason.SCAN_BLIND.value})
"""Reasons that may limit a motion without a stop, and that end with a command that leads away."""
OF_A_SOURCE = frozenset(
    reason.value
    for reason in (
        StopReason.SOURCE_LOST,
        StopReason.COMMAND_INVALID,
        StopReason.COMMAND_STALE,
        StopReason.COMMAND_TIMEOUT,
        StopReason.NO_COMMAND,
    )
)
"""Reasons of one command source. All others prevent every source from driving."""


class Request(NamedTuple):
    """A valid command of a source."""

    time_s: float
    source: str
    is_neutral: bool


class Pressed(NamedTuple):
    """An e-stop was pressed."""

    time_s: float


class Released(NamedTuple):
    """The e-stop was reset."""

    time_s: float


class Step(NamedTuple):
    """A decision of the supervisor."""

    time_s: float
    moves: bool
    """Whether it commands motion."""
    causes: frozenset[str]
    """What prevents or limits motion now."""
    reasons: frozenset[str]
    """The stop reasons, those that are only latched included."""
    owner: str
    """The source whose commands are executed."""


class Output(NamedTuple):
    """A command to the base, where it is recorded apart from the decision."""

    time_s: float
    moves: bool


class Motion(NamedTuple):
    """The motion of a base without a supervisor, by odometry."""

    time_s: float
    speed_m_s: float
    """Upper bound of the speed of any point of the hull; zero at rest."""


Event = Request | Pressed | Released | Step | Output | Motion
NAMES: dict[type[Event], str] = {
    Request: "commands",
    Step: "status of a supervisor",
    Motion: "odometry",
}


@dataclass
class Braking:
    """How long a base without a supervisor may move after it had to stop.

    Args:
        deceleration_m_s2: of the base.
    """

    deceleration_m_s2: float
    _speed_m_s: float | None = field(init=False, default=None)
    """The last speed before it had to stop; otherwise the first one after."""

    def limit_s(self, speed_m_s: float, *, must_stop: bool) -> float:
        """Process a speed; return the time to standstill from the moment at which the base had to stop."""
        if self._speed_m_s is None or not must_stop:
            self._speed_m_s = speed_m_s
        return self._speed_m_s / self.deceleration_m_s2 + GRACE_S

    def forget(self) -> None:
        self._speed_m_s = None


class Violation(NamedTuple):
    """A moment at which a rule began to be broken."""

    rule: str
    time_s: float
    sentence: str


class Verdict(NamedTuple):
    """The result of one monitor."""

    rule: str
    why_not: str
    """Why the rule was not judged; empty if it was."""
    moments: int
    """How many moments the rule was about."""
    broken: int
    """How often it began to be broken."""
    violations: tuple[Violation, ...]
    """The first of these."""

    @property
    def is_judged(self) -> bool:
        return not self.why_not


@dataclass
class Counts:
    """What a monitor has counted."""

    heard: set[type[Event]] = field(default_factory=set[type[Event]])
    moments: int = 0
    broken: int = 0
    violations: list[Violation] = field(default_factory=list[Violation])


@dataclass
class Monitor:
    """Judges one rule.

    Args:
        leeway_s: how far events of different topics may arrive out of order.
    """

    rule: ClassVar[str]
    needs: ClassVar[tuple[tuple[type[Event], ...], ...]]
    """Kinds of events without which the rule cannot be judged: one of each group is needed."""
    idle: ClassVar[str]
    """Why nothing was judged although all these events were recorded."""

    leeway_s: float = 0.0
    counts: Counts = field(kw_only=True, default_factory=Counts)
    _is_broken: bool = field(init=False, default=False)

    def hear(self, event: Event) -> Violation | None:
        """Process an event, in order of time. Return the violation if it begins one."""
        self.counts.heard.add(type(event))
        sentence = self._judge(event)
        if sentence is None:
            return None
        self.counts.moments += 1
        begins, self._is_broken = bool(sentence) and not self._is_broken, bool(sentence)
        if not begins:
            return None
        violation = Violation(self.rule, event.time_s, sentence)
        self.counts.broken += 1
        if len(self.counts.violations) < MAX_VIOLATIONS:
            self.counts.violations.append(violation)
        return violation

    def verdict(self) -> Verdict:
        missing = [group for group in self.needs if self.counts.heard.isdisjoint(group)]
        why_not = "; ".join(
            f"no {' and no '.join(NAMES[kind] for kind in group if kind in NAMES)}" for group in missing
        )
        why_not = why_not or ("" if self.counts.moments else self.idle)
        if why_not:
            return Verdict(self.rule, why_not, 0, 0, ())
        return Verdict(self.rule, "", self.counts.moments, self.counts.broken, tuple(self.counts.violations))

    def _judge(self, event: Event) -> str | None:
        """Return how the event breaks the rule; "" if it keeps it, None if the rule is not about it."""
        raise NotImplementedError


@dataclass
class SameStep(Monitor):
    """stop reason now ⇒ zero in the same step, and in the commands to the base between two such steps."""

    rule = "a stop reason ⇒ zero in the same step"
    needs = ((Step,),)
    idle = "no stop was recorded"

    _stopped_s: float = field(init=False, default=math.inf)
    """Since when each step has had a stop reason."""
    _output_s: float = field(init=False, default=math.inf)
    """The first motion that the base was commanded in this time."""

    def _judge(self, event: Event) -> str | None:
        match event:
            case Output(time_s, moves=True) if time_s >= self._stopped_s + self.leeway_s:
                self._output_s = min(self._output_s, time_s)
            case Step(time_s, moves, causes, reasons):
                stops = reasons | (causes - BARRIER - LIMITS)
                if not stops:
                    self._is_broken, self._stopped_s, self._output_s = False, math.inf, math.inf
                    return None
                self._stopped_s = min(self._stopped_s, time_s)
                if moves or time_s >= self._output_s + self.leeway_s:
                    return f"motion is commanded despite {', '.join(sorted(stops))}"
                return ""
            case _:
                pass
        return None


@dataclass
class NeutralFirst(Monitor):
    """moves ⇒ (no cause since the last neutral command of the source that drives)."""

    rule = "motion ⇒ no cause since the last neutral command"
    needs = ((Step,), (Request,))
    idle = "no motion after a stop was recorded"

    _everybody_s: float = field(init=False, default=-math.inf)
    """The last cause that applies to every source."""
    _own_s: dict[str, float] = field(init=False, default_factory=dict[str, float])
    _neutral_s: dict[str, float] = field(init=False, default_factory=dict[str, float])
    _driver: str | None = field(init=False, default=None)
    """The owner of the last step, if it moved the robot."""

    def _judge(self, event: Event) -> str | None:
        if isinstance(event, Request) and event.is_neutral:
            self._neutral_s[event.source] = event.time_s
        if not isinstance(event, Step):
            return None
        causes = event.causes - BARRIER - LIMITS
        # The stop of the source that drives applies to every source; a reason at rest only to its own.
        if causes - OF_A_SOURCE or (causes and self._driver == event.owner):
            self._everybody_s = event.time_s
        elif causes:
            self._own_s[event.owner] = event.time_s
        self._driver = event.owner if event.moves else None
        caused_s = max(self._everybody_s, self._own_s.get(event.owner, -math.inf))
        if not event.moves or math.isinf(caused_s):
            self._is_broken = False
            return None
        if self._neutral_s.get(event.owner, -math.inf) > caused_s - self.leeway_s:
            return ""
        return f"{event.owner or 'nobody'} moves the robot, without a neutral command since the stop {event.time_s - caused_s:.2f} s before"


@dataclass
class Estop(Monitor):
    """moves ⇒ (a reset since the last e-stop).

    Args:
        deceleration_m_s2: of a base without a supervisor: it may move while it brakes.
    """

    rule = "e-stop ⇒ zero until a reset"
    needs = ((Step, Output, Motion),)
    idle = "no e-stop was recorded"

    deceleration_m_s2: float = 1.5
    _pressed_s: float = field(init=False, default=math.inf)

    def __post_init__(self) -> None:
        self._braking = Braking(self.deceleration_m_s2)

    def _judge(self, event: Event) -> str | None:
        match event:
            case Pressed(time_s):
                self._pressed_s = min(self._pressed_s, time_s)
            case Released():
                self._pressed_s, self._is_broken = math.inf, False
            case Step(time_s, moves) | Output(time_s, moves) if time_s >= self._pressed_s:
                if moves and time_s >= self._pressed_s + self.leeway_s:
                    return f"motion is commanded {time_s - self._pressed_s:.2f} s after the e-stop, without a reset"
                if not moves:
                    return ""
            case Motion(time_s, speed_m_s):
                since_s = time_s - self._pressed_s
                limit_s = self._braking.limit_s(speed_m_s, must_stop=since_s >= 0.0)
                if since_s < 0.0:
                    return None
                if speed_m_s > 0.0 and since_s > limit_s + self.leeway_s:
                    return f"the robot moves {since_s:.2f} s after the e-stop, without a reset"
                return ""
            case _:
                pass
        return None


@dataclass
class FreshCommand(Monitor):
    """moves ⇒ (a command within the timeout).

    Args:
        timeout_s: maximum age of a command.
        deceleration_m_s2: of a base without a supervisor: it may move while it brakes.
    """

    rule = "motion ⇒ a fresh command"
    needs = ((Request,), (Step, Motion))
    idle = "no motion was recorded"

    timeout_s: float = 0.2
    deceleration_m_s2: float = 1.5
    _asked_s: dict[str, float] = field(init=False, default_factory=dict[str, float])
    _first_s: float | None = field(init=False, default=None)
    """The first event: the age of an earlier command is unknown."""

    def __post_init__(self) -> None:
        self._braking = Braking(self.deceleration_m_s2)

    def _judge(self, event: Event) -> str | None:
        if self._first_s is None:
            self._first_s = event.time_s
        match event:
            case Request(time_s, source):
                self._asked_s[source] = time_s
                self._braking.forget()
                return None
            case Step(time_s, moves=True, owner=owner):
                age_s, limit_s = time_s - self._asked_s.get(owner, self._first_s), self.timeout_s
            case Output(time_s, moves=True):
                age_s, limit_s = time_s - self._newest_s(), self.timeout_s
            case Motion(time_s, speed_m_s):
                age_s = time_s - self._newest_s()
                must_stop = age_s > self.timeout_s + self.leeway_s
                limit_s = self.timeout_s + self._braking.limit_s(speed_m_s, must_stop=must_stop)
                if speed_m_s <= 0.0:
                    self._is_broken = False
                    return None
            case Step() | Output():
                self._is_broken = False
                return None
            case _:
                return None
        if age_s <= limit_s + self.leeway_s + ROUNDING_S:
            return ""
        return f"the robot moves, and the last command is {age_s:.2f} s old"

    def _newest_s(self) -> float:
        assert self._first_s is not None  # set at the first event
        return max(self._asked_s.values(), default=self._first_s)


class Monitors:
    """All monitors of one recording.

    Args:
        timeout_s: maximum age of a command.
        deceleration_m_s2: of the base.
        leeway_s: how far events of different topics may arrive out of order; zero if they have the times that the law read.
    """

    def __init__(self, timeout_s: float, deceleration_m_s2: float = 1.5, leeway_s: float = 0.0) -> None:
        self._all: tuple[Monitor, ...] = (
            NeutralFirst(leeway_s),
            Estop(leeway_s, deceleration_m_s2),
            FreshCommand(leeway_s, timeout_s, deceleration_m_s2),
            SameStep(leeway_s),
        )

    def hear(self, event: Event) -> list[Violation]:
        """Process an event, in order of time, and return the violations that begin."""
        heard = (monitor.hear(event) for monitor in self._all)
        return [violation for violation in heard if violation is not None]

    def forget(self) -> None:
        """Forget the past: after a pause of the recording, it is unknown and breaks no rule."""
        self._all = tuple(replace(monitor) for monitor in self._all)  # with the same counts

    def verdicts(self) -> tuple[Verdict, ...]:
        return tuple(monitor.verdict() for monitor in self._all)
