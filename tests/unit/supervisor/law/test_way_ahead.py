"""The path ahead on an arc, at a point that the hull already grazes at the first checked pose."""

import numpy as np
import pytest

from supervisor.law.clearance import Barrier, permitted_scale, survey
from tests.scenes.scene import rectangle


def test_a_point_that_is_grazed_before_it_is_entered_limits_the_arc() -> None:
    """Between the stop distance and the margin for straying, nearly beside the hull; found in closed loop."""
    around = survey(rectangle(0.4, 0.4, 0.2), np.array([[-0.09855208338624676, -0.5070065163669566]]))
    barrier = Barrier(0.3, 1.5, 0.09, 0.0)
    scale, _ = permitted_scale(around, -1.0, 0.2701592525937784, barrier)
    assert 0.0 <= scale < 1.0
    # A little farther away, more is permitted.
    farther = survey(rectangle(0.4, 0.4, 0.2), np.array([[-0.09855208338624676, -0.52]]))
    assert permitted_scale(farther, -1.0, 0.2701592525937784, barrier)[0] >= scale


@pytest.mark.parametrize(
    "angular_rad_s",
    [
        # Every third one after each change, the others with the proofs.
        pytest.param(rate, marks=pytest.mark.proof if number % 3 else ())
        for number, rate in enumerate(np.linspace(-0.6, 0.6, 25).tolist())
    ],
)
def test_beside_a_long_hull_every_arc_has_a_share(angular_rad_s: float) -> None:
    hull = rectangle(0.4, 0.4, 0.2)
    for reaction_s in (0.03, 0.06, 0.09, 0.2):
        for x_m in np.linspace(-0.45, 0.45, 19):
            for y_m in np.linspace(0.495, 0.515, 5):
                around = survey(hull, np.array([[x_m, y_m]]))
                for linear_m_s in (-1.0, 0.4, 1.0):
                    scale, _ = permitted_scale(
                        around, linear_m_s, angular_rad_s, Barrier(0.3, 1.5, reaction_s, 0.0)
                    )
                    assert 0.0 <= scale <= 1.0
