"""The velocity that a line to the operator's program requests."""

import pytest

from passport.pilot import velocity_in
from teleop.pilots.pilot import NEUTRAL


@pytest.mark.parametrize(
    ("line", "velocity"),
    [
        (b"0.4 0.0\n", (0.4, 0.0)),
        (b"0.0 2.0\n", (0.0, 2.0)),
        (b"0.4\n", (0.4, 0.0)),
        (b"\n", NEUTRAL),
        (b"0.4 nan\n", NEUTRAL),
        (b"inf 0.0\n", NEUTRAL),
        (b"0.1 0.2 0.3\n", NEUTRAL),
        (b"fast\n", NEUTRAL),
        (b"\xff\n", NEUTRAL),
    ],
)
def test_a_line_that_is_no_velocity_requests_a_stop(line: bytes, velocity: tuple[float, float]) -> None:
    assert velocity_in(line) == velocity
