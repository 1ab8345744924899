"""How the simulation is, in the words of `diagnostic_msgs`: what the hull met, how time passes, what is wrong, who walks about."""

from collections.abc import Mapping
from dataclasses import dataclass

from sim.pace import Measured
from sim.sensor_faults import NO_FAULTS, SensorFaults
from wire.messages import DiagnosticArray, DiagnosticStatus, KeyValue, header

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR
HARDWARE = "sim"


@dataclass(frozen=True, slots=True)
class Health:
    """What is to be said.

    Attributes:
        touches: the hull has contact now.
        collisions: how often it came to one since the last reset.
        last_contact: with what, the last time.
        time_s: simulated.
        speed: simulated seconds in each second, as asked for.
        paused: no time passes.
        measured: the pace since the last report.
        faults: of the sensors, in force.
        movers: x, y [m] and yaw [rad] in the world of whoever goes about by itself.
    """

    touches: bool
    collisions: int
    last_contact: str | None
    time_s: float
    speed: float
    paused: bool
    measured: Measured
    faults: SensorFaults
    movers: Mapping[str, tuple[float, float, float]]


def to_diagnostics(health: Health) -> DiagnosticArray:
    """One status for each subject, the same four each time."""
    return DiagnosticArray(
        header(""), [_hull(health), _time(health), _sensors(health.faults), _movers(health.movers)]
    )


def contact_sentence(health: Health) -> str:
    """What the hull touches, or has touched since the last reset."""
    what = health.last_contact or "something"
    if health.touches:
        return f"the hull touches {what}"
    if health.collisions:
        times = "once" if health.collisions == 1 else f"{health.collisions} times"
        return f"the hull has hit something {times} since the last reset, last {what}"
    return "the hull has touched nothing since the last reset"


def pace_sentence(speed: float, measured: Measured) -> str:
    """That simulated time was lost, and what became of the speed."""
    return (
        f"cannot keep up: {measured.factor:.2f} times real time instead of {speed:g}; "
        f"{measured.lost_s:.2f} s of simulated time were skipped"
    )


def _hull(health: Health) -> DiagnosticStatus:
    level = ERROR if health.touches else WARN if health.collisions else OK
    return _status(
        "hull",
        level,
        contact_sentence(health),
        touches=str(health.touches).lower(),
        collisions=str(health.collisions),
        last_contact=health.last_contact or "",
    )


def _time(health: Health) -> DiagnosticStatus:
    level, sentence = OK, f"runs at {health.speed:g} times real time"
    if health.measured.lost_s > 0.0:
        level, sentence = WARN, pace_sentence(health.speed, health.measured)
    if health.paused:
        level, sentence = WARN, f"paused at {health.time_s:.3f} s"
    return _status(
        "time",
        level,
        sentence,
        time_s=f"{health.time_s:.3f}",
        speed=f"{health.speed:g}",
        real_time_factor=f"{health.measured.factor:.3f}",
        lost_s=f"{health.measured.lost_s:.3f}",
        paused=str(health.paused).lower(),
    )


def _sensors(faults: SensorFaults) -> DiagnosticStatus:
    if faults == NO_FAULTS:
        return _status("sensors", OK, "no fault in force", faults="none")
    return _status("sensors", WARN, f"faults in force: {faults}", faults=str(faults))


def _movers(movers: Mapping[str, tuple[float, float, float]]) -> DiagnosticStatus:
    places = {name: f"{x_m:.2f} {y_m:.2f} {yaw_rad:.2f}" for name, (x_m, y_m, yaw_rad) in movers.items()}
    return _status("movers", OK, f"{len(places)} on their ways" if places else "nobody goes about", **places)


def _status(subject: str, level: int, sentence: str, /, **values: str) -> DiagnosticStatus:
    return DiagnosticStatus(
        level,
        f"{HARDWARE}: {subject}",
        sentence,
        HARDWARE,
        [KeyValue(key, value) for key, value in values.items()],
    )
