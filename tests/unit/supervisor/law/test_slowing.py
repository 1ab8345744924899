"""The bound of a base that is still faster than its command: proven, computed as proven, and used by the law.

The proofs are statements in SMT-LIB over all real numbers, whose negation z3 refutes. Multiplied by the deceleration a,
distances and times become M = a·(c - d), X = a·x, S = a·T and s = a·t, so that a itself drops out where the base brakes
with exactly a.
"""

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from supervisor.law.clearance import (
    Barrier,
    Circle,
    ConvexPolygon,
    permitted_closing_speed,
    permitted_scale,
    permitted_while_slowing,
    survey,
)
from supervisor.law.decision import Mode
from supervisor.law.model import Odometry
from supervisor.law.reckoning import STANDSTILL, Velocity
from supervisor.law.transition import along
from tests.unit.supervisor.law.law_harness import ANY_AGE, NEUTRAL, TICK_S, Law, ring
from tests.unit.supervisor.law.smt import decided

# --- over all reals

BASE_SLOWS = """
(declare-const v Real) (declare-const u Real) (declare-const M Real) (declare-const S Real) (declare-const s Real)
(assert (and (>= u 0) (>= v u) (>= S 0) (>= s 0) (<= s S)))
(define-fun bound ((w Real)) Bool (<= (+ (* w w) (* w (- S v)) (/ (* v v) 2)) M))
(define-fun kappa ((w Real)) Bool (<= (+ (* w S) (/ (* w w) 2)) M))
(define-fun can-stop ((w Real) (X Real)) Bool (<= (* w w) (* 2 (- M X))))
(define-fun slowing () Bool (<= s (- v u)))
(define-fun speed () Real (ite slowing (- v s) u))
(define-fun driven () Real (ite slowing (- (* v s) (/ (* s s) 2)) (+ (* u s) (/ (* (- v u) (- v u)) 2))))
(assert (can-stop v 0))
"""

BASE_BRAKES_HARDER = """
(declare-const a Real) (declare-const b Real) (declare-const v Real) (declare-const u Real) (declare-const m Real)
(declare-const T Real) (declare-const t Real) (declare-const w Real)
(assert (and (> a 0) (>= b a) (>= u 0) (>= v u) (>= t 0) (<= t T) (<= (* v v) (* 2 a m))))
(assert (<= (+ (* u u) (* u (- (* a T) v)) (/ (* v v) 2)) (* a m)))
"""

DEAD_TIME = """
(declare-const v Real) (declare-const u Real) (declare-const M Real) (declare-const S Real) (declare-const D Real)
(assert (and (>= u 0) (>= v u) (>= D 0) (>= S D)))
(define-fun bound ((w Real)) Bool (<= (+ (* w w) (* w (- (- S D) v)) (/ (* v v) 2) (* D v)) M))
(assert (bound 0.0))
(assert (bound u))
"""

STATEMENTS = {
    "with the bound, the base can stop at every moment until the next decision": (
        BASE_SLOWS + "(assert (bound u)) (assert (not (can-stop speed driven)))",
        "unsat",
    ),
    "with κ alone, it cannot: this is the shortfall": (
        BASE_SLOWS + "(assert (kappa u)) (assert (not (can-stop speed driven)))",
        "sat",
    ),
    "the bound is the weakest: where it fails and the base reaches u, the base cannot stop": (
        BASE_SLOWS
        + "(assert (not (bound u))) (assert (not slowing)) (assert (= s S)) (assert (can-stop speed driven))",
        "unsat",
    ),
    "the bound permits no more than κ": (BASE_SLOWS + "(assert (bound u)) (assert (not (kappa u)))", "unsat"),
    "at the present speed, the bound is κ": (
        BASE_SLOWS + "(assert (= u v)) (assert (not (= (bound u) (kappa u))))",
        "unsat",
    ),
    "a base that brakes harder can stop while it slows down": (
        BASE_BRAKES_HARDER
        + "(assert (and (>= w u) (<= w v))) (assert (> (+ (* b w w) (* a (- (* v v) (* w w)))) (* 2 a b m)))",
        "unsat",
    ),
    "a base that brakes harder can stop when it has slowed down": (
        BASE_BRAKES_HARDER
        + "(assert (>= (* b t) (- v u)))"
        + "(assert (> (+ (* b u u) (* a (+ (- (* v v) (* u u)) (* 2 u (- (* b t) (- v u)))))) (* 2 a b m)))",
        "unsat",
    ),
    "after a dead time and the next decision, the base stops in time": (
        DEAD_TIME
        + """
        (define-fun brakes-at-once () Real (+ (* v D) (/ (* v v) 2)))
        (define-fun slows-first () Real
          (+ (* v D) (/ (* (- v u) (- v u)) 2) (* u (- (- S D) (- v u))) (* u (- v u)) (/ (* u u) 2)))
        (assert (> (ite (< (- S D) (- v u)) brakes-at-once slows-first) M))""",
        "unsat",
    ),
    "every speed below a permitted one is permitted": (
        DEAD_TIME + "(declare-const w Real) (assert (and (>= w 0) (<= w u))) (assert (not (bound w)))",
        "unsat",
    ),
}


@pytest.mark.parametrize("name", STATEMENTS)
def test_the_bound_is_proven_over_all_reals(name: str) -> None:
    statement, answer = STATEMENTS[name]
    assert decided(statement) == answer


# --- the code


NUMBERS = st.fractions(0, 3, max_denominator=50)


@settings(max_examples=300, deadline=None, derandomize=True)
@given(
    margin=NUMBERS,
    present=NUMBERS,
    deceleration=st.fractions(Fraction(1, 5), 4, max_denominator=50),
    reaction=NUMBERS,
    dead_share=st.fractions(0, 1, max_denominator=20),
)
def test_the_permitted_speed_fulfils_the_bound_in_exact_fractions_and_is_the_greatest(
    margin: Fraction, present: Fraction, deceleration: Fraction, reaction: Fraction, dead_share: Fraction
) -> None:
    a, dead = deceleration, dead_share * reaction
    barrier = Barrier(0.3, float(a), float(reaction), 0.0, float(dead))
    u = permitted_while_slowing(np.array([float(margin)]), np.array([float(present)]), barrier).item()

    def left(speed: float) -> Fraction:
        w = Fraction(speed)
        return w * w + w * (a * (reaction - dead) - present) + present * present / 2 + a * dead * present

    slack = Fraction(1, 10**9)
    if left(0.0) > a * margin + slack:
        assert u == 0.0
        return
    assert left(u) <= a * margin + slack * 10
    assert left(u + 1e-4) > a * margin, "a higher speed would not be permitted"


def test_a_base_that_can_no_longer_stop_is_commanded_zero() -> None:
    barrier = Barrier(0.3, 1.5, 0.2, 0.0)
    stops_m = 1.0 / 3.0
    for margin_m, is_zero in ((stops_m - 1e-9, True), (stops_m + 1e-9, False)):
        permitted = permitted_while_slowing(np.array([margin_m]), np.array([1.0]), barrier)
        assert (permitted.item() == 0.0) is is_zero


def test_a_base_that_is_slower_than_permitted_has_the_bound_of_a_steady_base() -> None:
    barrier = Barrier(0.3, 1.5, 0.2, 0.0)
    clearance = np.array([0.2, 0.3, 0.5, 1.0])
    steady = permitted_closing_speed(clearance, barrier)
    assert permitted_closing_speed(clearance, barrier, steady).tolist() == steady.tolist()
    faster = permitted_closing_speed(clearance, barrier, steady + 0.1)
    assert (faster <= steady).all()
    assert (faster[2:] < steady[2:]).all()


def shortfall_m(reaction_s: float, *, knows_the_base: bool) -> float:
    """Return by how much a base at 1 m/s that slows down toward a wall comes nearer than 0.3 m.

    It begins where it can just stop with the speed that κ permits once it has it. Decisions are `reaction_s` apart.
    """
    barrier, a, dt_s = Barrier(0.3, 1.5, reaction_s, 0.0), 1.5, 0.004
    nearest_m = math.inf
    for start_m in np.linspace(0.64, 1.6, 25):
        clearance_m, speed_m_s, command_m_s = float(start_m), 1.0, 1.0
        for number in range(round(4.0 / dt_s)):
            if number % round(reaction_s / dt_s) == 0:
                present = np.array([speed_m_s]) if knows_the_base else None
                command_m_s = permitted_closing_speed(np.array([clearance_m]), barrier, present).item()
            before_m_s = speed_m_s
            speed_m_s = max(command_m_s, speed_m_s - a * dt_s) if speed_m_s > command_m_s else command_m_s
            clearance_m -= (before_m_s + speed_m_s) / 2.0 * dt_s
            if speed_m_s < 0.01:
                break
        nearest_m = min(nearest_m, clearance_m)
    return 0.3 - nearest_m


def test_while_the_base_slows_down_the_inequality_holds() -> None:
    assert shortfall_m(0.6, knows_the_base=False) > 0.08
    assert shortfall_m(0.6, knows_the_base=True) < 0.002


@pytest.mark.parametrize("kind_m", [0.0, 0.05])
def test_the_way_ahead_has_the_bound_of_the_straight_way(kind_m: float) -> None:
    """Straight at a wall of points, the share of the twist equals the speed of the nearest point."""
    hull, barrier = Circle(0.25), Barrier(0.3, 1.5, 0.3, 0.0)
    wall = np.array([[0.25 + 0.3 + 0.36, y] for y in np.linspace(-kind_m, kind_m, 3)])
    around = survey(hull, wall)
    share, _ = permitted_scale(around, 1.0, 0.0, barrier, present=1.0)
    permitted = permitted_closing_speed(np.array([around.clearance_m.min()]), barrier, np.array([1.0]))
    assert share == pytest.approx(permitted.item(), rel=0.01)
    assert share < permitted_scale(around, 1.0, 0.0, barrier)[0] - 0.05


@pytest.mark.parametrize("twist", [(0.8, 0.9), (1.0, 1.2), (0.6, 1.5)])
@pytest.mark.parametrize("point", [(0.4, 0.45), (0.6, 0.45), (0.6, 0.3)])
def test_on_an_arc_the_bound_holds_along_the_path_in_shares_of_the_twist(
    twist: tuple[float, float], point: tuple[float, float]
) -> None:
    barrier, around = Barrier(0.3, 1.5, 0.3, 0.0), survey(Circle(0.25), np.array([point]))
    braking_s = max(twist[0], twist[1] * 0.25) / barrier.deceleration_m_s2
    steady, _ = permitted_scale(around, *twist, barrier)
    entered_s = steady * barrier.reaction_s + steady * steady * braking_s / 2.0
    present = steady + 0.2
    along_path = barrier._replace(deceleration_m_s2=1.0 / braking_s)
    permitted = permitted_while_slowing(np.array(entered_s), np.array(present), along_path)
    assert permitted_scale(around, *twist, barrier, present=present)[0] == pytest.approx(
        permitted.item(), rel=1e-4
    )


@pytest.mark.parametrize(
    ("point", "present", "reaction_s", "most"), [((1.1, 0.85), 1.5, 0.5, 0.97), ((1.25, 1.4), 2.5, 0.3, 0.0)]
)
def test_a_faster_base_looks_as_far_along_the_path_as_it_needs_to_stop(
    point: tuple[float, float], present: float, reaction_s: float, most: float
) -> None:
    """Neither point limits a base that is as fast as the command: it slows down, or stops, before them."""
    barrier, around = Barrier(0.3, 1.5, reaction_s, 0.0), survey(Circle(0.25), np.array([point]))
    assert permitted_scale(around, 1.0, 1.2, barrier, present=1.0)[0] == 1.0
    assert permitted_scale(around, 1.0, 1.2, barrier, present=present)[0] <= most


def test_a_base_that_is_too_fast_below_the_command_has_the_bound_of_each_point() -> None:
    """The corner of the hull closes on the point; the path ahead alone would permit more."""
    hull = ConvexPolygon(((0.4, -0.3), (0.4, 0.3), (-0.4, 0.3), (-0.4, -0.3)))
    barrier, around = Barrier(0.3, 1.5, 0.5, 0.0), survey(hull, np.array([(0.873, -0.51)]))
    closing = around.per_linear.item()
    permitted = permitted_closing_speed(around.clearance_m, barrier, np.array([0.8 * closing]))
    share, _ = permitted_scale(around, 1.0, 0.0, barrier, present=0.8)
    assert share == pytest.approx(permitted.item() / closing)
    assert 0.0 < share < permitted_scale(around, 1.0, 0.0, barrier)[0]


def test_the_speed_along_the_command_is_a_share_of_it() -> None:
    assert along(Velocity(1.0, 0.0), Velocity(0.5, 0.0), 0.25) == pytest.approx(2.0)
    assert along(Velocity(1.0, 2.0), Velocity(0.5, 1.0), 0.25) == pytest.approx(2.0)
    assert along(Velocity(0.0, -2.0), Velocity(0.0, 1.0), 0.25) == pytest.approx(-2.0)
    assert along(Velocity(0.0, 2.0), Velocity(0.5, 0.0), 0.25) == 0.0


# --- the law


def commanded_while_driving(law: Law, command: Velocity, measured: Velocity) -> Velocity:
    law.tick(("teleop", NEUTRAL), odometry=Odometry(STANDSTILL, law.now_s + TICK_S))
    for _ in range(3):
        law.tick(("teleop", command), odometry=Odometry(measured, law.now_s + TICK_S))
    return law.decision.output


def test_a_base_that_is_faster_than_its_command_is_commanded_less_and_is_not_stopped() -> None:
    outputs: list[Velocity] = []
    for measured in (Velocity(0.3, 0.0), Velocity(0.9, 0.0)):
        law = Law(replace(ANY_AGE, transport_s=0.3), room_m=3.0)
        law.ranges = ring(ahead_m=0.25 + 0.3 + 0.30)
        outputs.append(commanded_while_driving(law, Velocity(0.6, 0.0), measured))
        assert law.decision.mode is Mode.LIMITED
        assert law.decision.reasons == ()
    assert 0.0 < outputs[1].linear_m_s < outputs[0].linear_m_s


def test_a_base_is_too_fast_only_beyond_the_noise_of_odometry() -> None:
    """At 0.5 m/s, 0.93 of it are permitted: the difference of 0.035 m/s is less than the noise."""
    outputs: list[float] = []
    for measured_m_s in (0.465, 0.5):
        law = Law(replace(ANY_AGE, transport_s=0.3), room_m=3.0)
        law.ranges = ring(ahead_m=0.25 + 0.3 + 0.221)
        outputs.append(
            commanded_while_driving(law, Velocity(0.5, 0.0), Velocity(measured_m_s, 0.0)).linear_m_s
        )
    assert 0.46 < outputs[0] < 0.47
    assert outputs[1] == pytest.approx(outputs[0], abs=1e-9)
