"""What `lifeline ros2 check-base` advises."""

import pytest

from ros2.check_base import GOOD_S, LONGEST_S, advice
from supervisor.config import SupervisorSection
from wire.host.config import ConfigError, section

SETTING = "set base_timeout_s in [supervisor] to at least"


@pytest.mark.parametrize("took_s", [0.301, 0.31])
def test_a_short_timeout_is_to_be_set_rounded_up(took_s: float) -> None:
    assert advice(took_s, "the clock") == f"{SETTING} 0.31"


def test_a_long_timeout_is_to_be_reduced_and_set_until_then() -> None:
    assert advice(GOOD_S, None) == f"{SETTING} 1.00"
    reduce, until_then = advice(1.001, None).splitlines()
    assert reduce.startswith("more than 1 s is long: reduce the cmd_vel timeout")
    assert until_then == f"until then, {SETTING} 1.01"
    assert advice(1.5, "the clock is behind").startswith("more than 1 s is long: the clock is behind")


def test_a_timeout_that_the_supervisor_does_not_accept_is_not_to_be_set() -> None:
    assert SETTING in advice(LONGEST_S, None)
    assert SETTING not in advice(2.001, None)
    assert section({"supervisor": {"base_timeout_s": LONGEST_S}}, "supervisor", SupervisorSection)
    with pytest.raises(ConfigError):
        section({"supervisor": {"base_timeout_s": 2.01}}, "supervisor", SupervisorSection)
