"""The theorem of docs/safety-law.md ("What is proven"), step by step, over all real numbers and in exact fractions.

Each step has assumptions and a claim in SMT-LIB. z3 finds no numbers that fulfil the assumptions and not the claim, and
some that fulfil the assumptions: no step is empty. test_slowing.py has the steps of a base that is faster than its command.

    a  deceleration        T  reaction time        m  margin c - d       v  speed        u  commanded speed
    t  time since the decision                     x  distance driven since the decision

As in test_slowing.py, distances are multiplied by a, and so are times, where this makes a statement quadratic:
M = a·m, X = a·x, S = a·T, s = a·t.
"""

import math
from dataclasses import replace
from fractions import Fraction
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from supervisor.law import clearance
from supervisor.law.clearance import (
    POSES,
    Barrier,
    Circle,
    ConvexPolygon,
    Hull,
    permitted_closing_speed,
    permitted_scale,
    survey,
)
from supervisor.law.model import LawConfig
from supervisor.law.permission import renewed
from supervisor.law.reckoning import Velocity
from tests.scenes.scene import rectangle
from tests.unit.supervisor.law.law_harness import CONFIG
from tests.unit.supervisor.law.smt import decided, reals


class Step(NamedTuple):
    """One step of the proof."""

    given: str
    claim: str


# --- the formula

STOPS = (
    reals("v M S s")
    + """
(assert (and (>= v 0) (>= S 0) (>= M 0) (>= s 0)))
(define-fun braked () Real (ite (<= s S) 0.0 (ite (<= s (+ S v)) (- s S) v)))
(define-fun driven () Real (- (* v (ite (<= s S) s (+ S braked))) (/ (* braked braked) 2)))
(define-fun permitted () Bool (<= (+ (* v S) (/ (* v v) 2)) M))
"""
)
"""Drive at v for T, then brake with a to standstill: what has been braked, and the distance, after the time t."""

ROOT = (
    reals("M S r w")
    + """
(assert (and (>= S 0) (>= M 0) (>= w 0) (>= r 0) (= (* r r) (+ (* S S) (* 2 M)))))
(define-fun kappa () Real (- r S))
"""
)
"""κ as the code computes it, and another speed w."""

# --- one decision

DECISION = (
    reals("v u M S X w")
    + """
(assert (and (>= u 0) (>= v 0) (<= v u) (>= S 0) (>= X 0) (>= w 0) (>= M 0)))
(define-fun can-stop ((w Real) (X Real)) Bool (<= (* w w) (* 2 (- M X))))
(assert (<= (+ (* u S) (/ (* u u) 2)) M))
"""
)
"""The base has v <= u <= κ. Until the next decision it has some speed w and has driven some distance x."""

BRAKING = (
    reals("a b v t m")
    + """
(assert (and (> a 0) (>= b a) (>= v 0) (>= t 0) (<= (* b t) v) (<= (* v v) (* 2 a m))))
"""
)
"""A base that brakes with b >= a, t after it has begun to."""

# --- the path ahead

PATH = (
    reals("s T B tau t")
    + """
(assert (and (>= s 0) (>= T 0) (> B 0) (>= tau 0) (>= t 0)))
(define-fun permitted ((s Real)) Bool (<= (+ (* s T) (/ (* s s B) 2)) tau))
(define-fun braked () Real (ite (<= t T) 0.0 (ite (<= (- t T) (* s B)) (- t T) (* s B))))
(define-fun along () Real (- (* s (ite (<= t T) t (+ T braked))) (/ (* braked braked) (* 2 B))))
"""
)
"""The share s of a twist. At the full twist, the place τ is reached after the time τ, and braking takes B = |V|/a. At a
share that falls by 1/B a second, the base is where it would be at the full twist after the time `along`."""

CHORD = (
    reals("A C L near far share")
    + """
(assert (and (>= A 0) (>= C 0) (>= L 0) (>= share 0) (<= share 1) (>= near (* A A)) (>= far (* C C))))
(define-fun square () Real (- (+ (* (- 1 share) near) (* share far)) (* share (- 1 share) L L)))
(define-fun linear () Real (+ (* (- 1 share) A) (* share C)))
"""
)
"""A point moves relative to the hull by L between two poses at which its clearances are A and C. At the share of the way,
the square of its clearance, the distance from some place of the hull, follows from the squared distances of that place
from both ends, which are at least A² and C²: this is Stewart's theorem."""

STEWART = (
    reals("x y p q share")
    + """
(define-fun square ((x Real) (y Real)) Real (+ (* x x) (* y y)))
(define-fun g () Real (square (+ (* (- 1 share) x) (* share p)) (+ (* (- 1 share) y) (* share q))))
(define-fun L () Real (square (- x p) (- y q)))
"""
)
"""The place of the hull is the origin, the two ends are (x, y) and (p, q)."""

ARC = (
    reals("rho L h")
    + """
(assert (and (> rho 0) (>= L 0) (>= h 0) (<= h rho) (= (* h (- (* 2 rho) h)) (/ (* L L) 4))))
"""
)
"""A chord of length L in a circle of radius rho, and its sagitta h."""

# --- everything above the base dies

ALONE = (
    reals("u v V S R D M N")
    + """
(assert (and (>= u 0) (<= u V) (>= S 0) (>= R 0) (>= N 0) (>= D 0) (<= D S) (<= D R) (>= v u)))
(define-fun decided () Bool (<= (+ (* u S) (/ (* u u) 2)) M))
(define-fun slows () Bool (<= (+ (* u u) (* u (- (- S D) v)) (/ (* v v) 2) (* D v)) M))
(define-fun left-alone () Bool (<= (+ (* u R) (/ (* u u) 2)) (+ M N)))
(define-fun slows-alone () Bool (<= (+ (* u u) (* u (- (- R D) v)) (/ (* v v) 2) (* D v)) (+ M N)))
(assert (<= (* V (- R S)) N))
"""
)
"""S is the reaction time of a decision, R that of a base that is left alone, N the difference of the two distances."""

RENEWED = (
    reals("T delta tick x")
    + """
(assert (and (> T 0) (>= delta 0) (<= delta tick) (>= x 0) (<= x T)))
(define-fun fresh () Real (/ (* 2 T) (* (+ T (/ tick 2)) (+ T (/ tick 2)))))
(define-fun driven () Real (* fresh (- (+ x delta) (/ (* x (+ x delta)) (* 2 T)))))
"""
)
"""The permitted speed of a blind budget of 1 falls linearly over the timeout T. Ticks are delta apart, the last one
before the timeout is at x = n·delta: the distance is delta·fresh·(1 - k·delta/T), summed over k = 0 … n."""

STEPS = {
    "a base that reacts for T and brakes with a stops within the margin if v·T + v²/2a is at most the margin": Step(
        STOPS + "(assert permitted)", "(<= driven M)"
    ),
    "a base that drives faster than that is beyond the margin when it stands": Step(
        STOPS + "(assert (not permitted)) (assert (= s (+ S v)))", "(> driven M)"
    ),
    "kappa is a speed, and reacting and braking from it takes exactly the margin": Step(
        ROOT, "(and (>= kappa 0) (= (+ (* kappa S) (/ (* kappa kappa) 2)) M))"
    ),
    "kappa is the greatest permitted speed": Step(
        ROOT + "(assert (<= (+ (* w S) (/ (* w w) 2)) M))", "(<= w kappa)"
    ),
    "each lower speed than kappa is permitted": Step(
        ROOT + "(assert (<= w kappa))", "(<= (+ (* w S) (/ (* w w) 2)) M)"
    ),
    "from its present speed, a base with a permitted command can stop within the margin": Step(
        DECISION, "(can-stop v 0.0)"
    ),
    "until the next decision, a base that is never faster than its command can stop, however it accelerates": Step(
        DECISION + "(assert (and (<= w u) (<= X (* u S))))", "(can-stop w X)"
    ),
    "a clearance that is measured too long by e costs at most e": Step(
        reals("v e M") + "(assert (and (>= v 0) (>= e 0) (<= (* v v) (* 2 (+ M e)))))",
        "(>= (- M (/ (* v v) 2)) (- e))",
    ),
    "a point that is out of reach permits V": Step(
        ROOT + "(assert (>= M (+ (* w S) (/ (* w w) 2))))", "(>= kappa w)"
    ),
    "a base that brakes with a or more can stop at each moment of its braking": Step(
        BRAKING, "(<= (* (- v (* b t)) (- v (* b t))) (* 2 a (- m (- (* v t) (/ (* b t t) 2)))))"
    ),
    "a base that can stop is not beyond the margin": Step(BRAKING, "(>= m 0)"),
    "at a permitted share, the hull never reaches the place along the same path": Step(
        PATH + "(assert (permitted s))", "(<= along tau)"
    ),
    "at a greater share, it does": Step(
        PATH + "(assert (not (permitted s))) (assert (= t (+ T (* s B))))", "(> along tau)"
    ),
    "the share that the code computes stops exactly at the place": Step(
        reals("r T B tau")
        + "(assert (and (>= T 0) (> B 0) (>= tau 0) (>= r 0) (= (* r r) (+ (* T T) (* 2 B tau)))))"
        + "(define-fun s () Real (/ (- r T) B))",
        "(and (>= s 0) (= (+ (* s T) (/ (* s s B) 2)) tau))",
    ),
    "the distance from a place to a point on a chord follows from those to its ends": Step(
        STEWART,
        "(= g (- (+ (* (- 1 share) (square x y)) (* share (square p q))) (* share (- 1 share) L)))",
    ),
    "between two poses, the clearance is at least the root of (linear² - L²/4)": Step(
        CHORD, "(>= square (- (* linear linear) (/ (* L L) 4)))"
    ),
    "an arc deviates from its chord L by at most L²/4 radius": Step(ARC, "(<= (* 4 rho h) (* L L))"),
    "the second bound follows from the first if V times the longer reaction is at most the shorter distance": Step(
        ALONE + "(assert decided)", "left-alone"
    ),
    "so it does for a base that slows down": Step(ALONE + "(assert slows)", "slows-alone"),
    "a command that is not renewed drives at most its budget": Step(RENEWED, "(<= driven 1)"),
}


@pytest.mark.parametrize("name", STEPS)
def test_each_step_of_the_theorem_holds_over_all_reals(name: str) -> None:
    step = STEPS[name]
    assert decided(step.given) == "sat", "the step is empty"
    assert decided(step.given + f"(assert (not {step.claim}))") == "unsat"


# --- the code, in exact fractions

ROUNDING = Fraction(1, 10**12)
"""[m, m²/s²] Tolerance of the inequalities: the code computes in doubles. For the numbers drawn here, no intermediate result
exceeds 100, so that each of about ten operations errs by at most 100·2⁻⁵³ ≈ 1e-14; a speed enters the distance times
T + u/a < 20."""

FINER = Fraction(1, 10**4)
"""A speed that is higher by this many m/s is not permitted any more: where the bound of a slowing base has a double root,
it exceeds the margin by the square of this only, 1e-8, which still is far more than the rounding."""

MARGINS = st.one_of(st.floats(0.0, 5.0), st.floats(0.0, 1e-6))
DECELERATIONS = st.floats(0.1, 4.0)
TIMES = st.one_of(st.just(0.0), st.floats(1e-3, 1.0))
SPEEDS = st.floats(0.0, 2.0)
EXACT = settings(max_examples=300, deadline=None, derandomize=True)


def steady(u: float | Fraction, barrier: Barrier) -> Fraction:
    """Return u·T + u²/2a [m]."""
    u = Fraction(u)
    return u * Fraction(barrier.reaction_s) + u * u / (2 * Fraction(barrier.deceleration_m_s2))


def slowing(u: float | Fraction, present: float, barrier: Barrier) -> Fraction:
    """Return (u² + u·(a·(T - D) - v) + v²/2 + a·D·v) / a [m]."""
    u, v, a = Fraction(u), Fraction(present), Fraction(barrier.deceleration_m_s2)
    dead_s = Fraction(barrier.dead_time_s)
    return (u * u + u * (a * (Fraction(barrier.reaction_s) - dead_s) - v) + v * v / 2) / a + dead_s * v


@EXACT
@given(margin=MARGINS, a=DECELERATIONS, reaction_s=TIMES, stop_m=st.floats(0.05, 1.0))
def test_kappa_fulfils_its_inequality_in_exact_fractions_and_is_the_greatest(
    margin: float, a: float, reaction_s: float, stop_m: float
) -> None:
    barrier, clearance_m = Barrier(stop_m, a, reaction_s, 0.0), stop_m + margin
    exact_m = max(Fraction(0), Fraction(clearance_m) - Fraction(stop_m))
    kappa = permitted_closing_speed(np.array([clearance_m]), barrier).item()
    assert steady(kappa, barrier) <= exact_m + ROUNDING
    assert steady(kappa + FINER, barrier) > exact_m


@EXACT
@given(
    margin=MARGINS, present=SPEEDS, a=DECELERATIONS, reaction_s=TIMES, dead=st.sampled_from((0.0, 0.5, 1.0))
)
def test_the_speed_of_a_base_that_is_faster_fulfils_both_inequalities_and_is_the_greatest_or_zero(
    margin: float, present: float, a: float, reaction_s: float, dead: float
) -> None:
    barrier = Barrier(0.25, a, reaction_s, 0.0, dead * reaction_s)
    exact_m = Fraction(0.25 + margin) - Fraction(0.25)
    u = permitted_closing_speed(np.array([0.25 + margin]), barrier, np.array([present])).item()
    assert steady(u, barrier) <= exact_m + ROUNDING
    if steady(present, barrier) <= exact_m - ROUNDING:
        assert steady(u + FINER, barrier) > exact_m, "a base that is not too fast has kappa"
    elif slowing(0.0, present, barrier) > exact_m + ROUNDING / Fraction(a):
        assert u == 0.0, "it can no longer stop"
    elif steady(present, barrier) > exact_m + ROUNDING:
        assert slowing(u, present, barrier) <= exact_m + ROUNDING / Fraction(a)
        assert slowing(u + FINER, present, barrier) > exact_m


@EXACT
@given(
    hull=st.sampled_from((Circle(0.25), rectangle(0.25, 0.5, 0.2))),
    margin=st.floats(0.0, 3.0),
    speed=st.floats(0.02, 1.5),
    sign=st.sampled_from((1.0, -1.0)),
    a=DECELERATIONS,
    reaction_s=st.floats(1e-3, 1.0),
)
def test_straight_at_a_point_the_share_fulfils_the_inequality_in_exact_fractions_and_is_the_greatest(
    hull: Hull, margin: float, speed: float, sign: float, a: float, reaction_s: float
) -> None:
    barrier = Barrier(0.25, a, reaction_s, 0.0)
    rim_m = 0.5 if isinstance(hull, ConvexPolygon) and sign < 0.0 else 0.25
    around = survey(hull, np.array([[sign * (rim_m + 0.25 + margin), 0.0]]))
    exact_m = Fraction(rim_m + 0.25 + margin) - Fraction(rim_m) - Fraction(0.25)
    share, _ = permitted_scale(around, sign * speed, 0.0, barrier)
    moves = Fraction(share) * Fraction(speed)
    assert steady(moves, barrier) <= exact_m + ROUNDING
    assert share == 1.0 or steady(moves + FINER, barrier) > exact_m


@EXACT
@given(
    timeout_s=st.floats(0.05, 2.0),
    budget_m=st.floats(0.01, 2.0),
    transport_s=st.floats(0.01, 0.1),
    tick_share=st.floats(0.2, 1.0),
    twist=st.tuples(st.floats(-1.0, 1.0), st.floats(-2.0, 2.0)).filter(any),
)
def test_in_exact_fractions_a_command_that_is_not_renewed_drives_at_most_the_blind_budget(
    timeout_s: float, budget_m: float, transport_s: float, tick_share: float, twist: tuple[float, float]
) -> None:
    config = law_config(command_timeout_s=timeout_s, blind_budget_m=budget_m, transport_s=transport_s)
    driven_m = driven_blindly_m(Velocity(*twist), tick_share * transport_s, config)
    assert driven_m <= Fraction(budget_m) * (1 + ROUNDING)


@pytest.mark.parametrize("ticks", [3, 10, 100])
def test_the_blind_budget_is_used_up_where_the_timeout_ends_in_the_middle_of_a_tick(ticks: int) -> None:
    config = law_config(command_timeout_s=(ticks + 0.5) * 0.0625, blind_budget_m=0.2, transport_s=0.0625)
    driven_m = driven_blindly_m(Velocity(0.7, 0.0), 0.0625, config)
    assert driven_m == pytest.approx(0.2, abs=float(ROUNDING))


def law_config(**changes: float) -> LawConfig:
    return replace(CONFIG, **changes)  # type: ignore[arg-type]


def driven_blindly_m(twist: Velocity, tick_s: float, config: LawConfig) -> Fraction:
    """Return the sum of the permitted speeds over all ticks until the timeout, each for one tick, of centre or rim [m]."""
    rim_m_s = max(
        Fraction(config.creep_m_s),
        abs(Fraction(twist.linear_m_s)),
        abs(Fraction(twist.angular_rad_s)) * Fraction(config.hull.radius_m),
    )
    ages_s = (tick_s * number for number in range(math.floor(config.command_timeout_s / tick_s) + 1))
    return sum(
        (Fraction(renewed(age_s, twist, config)) * rim_m_s * Fraction(tick_s) for age_s in ages_s),
        Fraction(0),
    )


@EXACT
@given(
    hull=st.sampled_from((Circle(0.25), rectangle(0.4, 0.4, 0.2), rectangle(0.6, 0.1, 0.25))),
    twist=st.tuples(st.floats(-1.0, 1.0), st.floats(-2.0, 2.0)),
    away=st.tuples(st.floats(0.3, 1.2), st.floats(-math.pi, math.pi)),
    between_s=st.floats(0.01, 0.2),
    share=st.floats(0.0, 1.0),
)
def test_between_two_checked_poses_the_clearance_deviates_by_at_most_the_proven_bound(
    hull: Hull, twist: tuple[float, float], away: tuple[float, float], between_s: float, share: float
) -> None:
    v, w = twist
    point = np.array([[away[0] * math.cos(away[1]), away[0] * math.sin(away[1])]])
    poses = np.concatenate(
        [np.zeros((1, 3)), *(clearance._along_arc(v, w, s * between_s, 1) for s in (share, 1.0))]  # pyright: ignore[reportPrivateUsage]
    )
    begins, inside, ends = hull.clearance_along(point, poses)[:, 0].tolist()
    seen = clearance._seen_from(point, poses)[:, 0]  # pyright: ignore[reportPrivateUsage]
    moved_m = math.dist(seen[0], seen[2])
    linear_m = (1.0 - share) * begins + share * ends
    if min(begins, ends) >= 0.0 and linear_m >= moved_m / 2.0:
        # Relative to the hull, the point moves with v and, about the base, with w: its path bends by this at most.
        arc_m = math.hypot(v - w * point[0, 1], w * point[0, 0]) * abs(w) * between_s**2 / 8.0
        chord_m = math.sqrt(linear_m**2 - moved_m**2 / 4.0)
        assert inside >= chord_m - arc_m - 1e-9


@pytest.mark.parametrize(("reaction_s", "lost_m"), [(0.13, 0.0025), (0.43, 0.0068), (0.63, 0.0109)])
def test_at_the_stop_distance_the_deviation_is_a_few_millimetres(reaction_s: float, lost_m: float) -> None:
    """At 1 m/s with a lidar of 20 Hz (poses 8 cm apart), with one of 5 Hz, and with 5 Hz and a dead time of 0.2 s (16 cm)."""
    stop_m, apart_m = CONFIG.stop_distance_m, (reaction_s + 0.5 / CONFIG.deceleration_m_s2) / POSES
    assert stop_m - math.sqrt(stop_m**2 - apart_m**2 / 4.0) == pytest.approx(lost_m, abs=5e-5)
