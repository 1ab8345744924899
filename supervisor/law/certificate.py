"""Which commands pass unchanged at the next step, and until when: known from the last step, without another one.

Most commands arrive on a free path and change nothing but the velocity. The service publishes such a command before the
step that decides it, which takes several times as long as everything else on the way of a command.

A certificate holds while nothing has arrived but commands of the owner and odometry, no deadline has passed, and no point is
within the reach of the barrier. Then `step` has no reason, and permits the whole command:

* Reasons. The last step had no cause. A new one comes from an input, of which all others are outside of the certificate, or
  from time: from a scan, odometry, a station, the law's own steps or a base that lags, each of which has its deadline here.
* Owner. The command is judged as in the step, by the same function. No other source that requests motion can take over.
* Barrier. V bounds the speed of the hull under every twist that the step considers: the command, the twists that the base
  may still have after the last output, and odometry. By odometry, the hull has moved by at most V·t since its last sample.
  A point farther away than the reach of the barrier at V and this distance limits nothing (reach.py).
* Limits. Each is computed as in the step, and must permit the whole command.

The tests compare it with `step` for every edge of the model check, and in random scenes. What the certificate does not cover waits for the step.
"""

import math
from typing import NamedTuple

from supervisor.law.base_motion import PATIENCE_S
from supervisor.law.decision import Decision
from supervisor.law.interlock import Source, accept, own_causes
from supervisor.law.model import Inputs, LawConfig
from supervisor.law.permission import barriers, measured, renewed
from supervisor.law.reach import Place, reach_m
from supervisor.law.reckoning import STANDSTILL, Odometer, Velocity, between
from supervisor.law.sight import is_assumed, mounts_confirmed, usable
from supervisor.law.state import State
from supervisor.law.writers import speaking

ROUNDING = 1e-6
"""[s, m] Larger than the rounding error of sums and differences of times and distances."""


class Certificate(NamedTuple):
    """What the last step has proven about the next one."""

    config: LawConfig
    owner: Source
    """The owner of the wheels: armed, and the only live source that requests motion."""
    until_s: float
    """The time of the first deadline, apart from that of the command."""
    odometer: Odometer
    odometry_writers: tuple[bytes, ...]
    """The only active writer of odometry; none without odometry."""
    fastest: Velocity
    """Bounds of the base's velocity on each axis, apart from the next command and odometry [m/s, rad/s]."""
    free_m: float
    """Distance from the hull, at the odometer's pose, within which no point is; seen, remembered or hidden."""
    taken_s: float
    """When the oldest scan was taken."""
    period_before_s: float
    """The least time of a scan less its period: the age since then is that of its points when the next scan comes."""


def certify(state: State, decision: Decision) -> Certificate | None:
    """Return what is known about the next step; None if it may decide otherwise than the command requests.

    Args:
        state: the state after a step.
        decision: the decision of this step.
    """
    config, interlock, base, sight, clock = state
    owner, now_s = interlock.owning, clock.now_s
    if decision.causes or decision.output == STANDSTILL:
        return None
    assert owner is not None  # without an owner, zero is commanded
    assert now_s is not None  # this is the state after a step
    if any(not (s.neutral or own_causes(s, now_s, config)) for s in interlock.sources if s is not owner):
        return None
    writers = tuple(writer.gid for writer in base.writers[:1])
    if not {*speaking(base.writers, config.odom_timeout_s, now_s)}.issubset(writers):
        return None
    scans = usable(sight, config, now_s)
    if is_assumed(scans) or not (mounts_confirmed(sight) or math.isinf(config.unconfirmed_m_s)):
        return None
    odometry_s = now_s if base.odometry is None else base.odometry.arrival_s
    deadlines_s = [scan.taken_s + config.lidars[place].timeout_s for place, scan in scans]
    deadlines_s += [
        now_s + config.overrun_s,
        odometry_s + config.odom_timeout_s,
        interlock.stations.expires_s,
    ]
    if base.following.since_s is not None:
        deadlines_s.append(base.following.since_s + PATIENCE_S + config.dead_time_s)
    places = [Place(scan.view.pose, scan.around) for _, scan in scans if scan.view is not None]
    return Certificate(
        config,
        owner,
        until_s=min(deadlines_s) - ROUNDING,
        odometer=base.odometer,
        odometry_writers=writers,
        fastest=_faster(_faster(base.following.most, base.output), base.odometer.velocity),
        free_m=min(_free_m(place, base.odometer) for place in (*places, *sight.places)),
        taken_s=min(scan.taken_s for _, scan in scans),
        period_before_s=min(scan.taken_s - scan.period_s for _, scan in scans),
    )


def foreseen(certificate: Certificate | None, now_s: float, inputs: Inputs) -> Velocity | None:
    """Return the velocity that `step` will decide; None if this is not known without it.

    Args:
        certificate: of the last step.
        now_s: the time of the next step.
        inputs: the inputs of the next step.
    """
    if certificate is None or now_s > certificate.until_s or not _is_covered(certificate, inputs):
        return None
    wanted, sent_s = _heard(certificate, now_s, inputs)
    if wanted is None or wanted == STANDSTILL:
        return wanted
    config = certificate.config
    if min(renewed(now_s - sent_s, wanted, config), measured(wanted, config)) < 1.0:
        return None
    fastest = _faster(certificate.fastest, config.useful(wanted))
    if inputs.odometry is not None:
        fastest = _faster(fastest, inputs.odometry.velocity)
    fastest_m_s = config.hull_speed_m_s(fastest)
    age_s, next_s = now_s - certificate.taken_s, now_s - certificate.period_before_s
    bounds = barriers(config, age_s, next_s, fastest_m_s)
    moved_m = fastest_m_s * (now_s - certificate.odometer.at_s)
    needed_m = max(reach_m(fastest_m_s, bound) for bound in bounds) + moved_m
    return wanted if needed_m + ROUNDING <= certificate.free_m else None


def _is_covered(certificate: Certificate, inputs: Inputs) -> bool:
    """Return whether nothing has arrived but commands, the odometry of its only writer, and names of unknown sources."""
    odometry = inputs.odometry
    return not (
        inputs.liveliness
        or inputs.scans
        or inputs.undecodable_lidars
        or inputs.estop
        or inputs.estop_unrecorded
        or inputs.presences
        or inputs.station_ends
        or inputs.reset
        or inputs.suspended_s
        or any(gid not in certificate.odometry_writers for gid in inputs.odometry_writers)
        or (odometry is not None and odometry.arrival_s < certificate.odometer.at_s)
    )


def _heard(certificate: Certificate, now_s: float, inputs: Inputs) -> tuple[Velocity | None, float]:
    """Return the owner's velocity after the commands, and when it was sent [s]; None unless all are accepted and in time."""
    config, owner = certificate.config, certificate.owner
    for command in inputs.commands:
        if command.source != owner.config.name:
            return None, math.inf
        owner = accept(owner, command, config)
    is_accepted = owner.counts.accepted == certificate.owner.counts.accepted + len(inputs.commands)
    is_live = is_accepted and not own_causes(owner, now_s, config)
    return (owner.velocity if is_live else None), owner.sent_s


def _faster(one: Velocity, other: Velocity) -> Velocity:
    """Return the higher speed of two twists on each axis."""
    return Velocity(
        max(abs(one.linear_m_s), abs(other.linear_m_s)), max(abs(one.angular_rad_s), abs(other.angular_rad_s))
    )


def _free_m(place: Place, odometer: Odometer) -> float:
    """Return the least clearance of a place's points, less the distance that the hull has moved since [m]."""
    x_m, y_m, yaw_rad = between(place.pose, odometer.pose)
    moved_m = math.hypot(x_m, y_m) + abs(yaw_rad) * place.around.hull.radius_m
    return float(place.around.clearance_m.min(initial=math.inf)) - moved_m
