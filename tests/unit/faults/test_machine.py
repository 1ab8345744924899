"""State that survives a virtual supervisor's process."""

from faults.simulated.world import Machine


def test_a_sleep_is_reported_once_and_several_add_up() -> None:
    subject = Machine()
    subject.sleep(1.0)
    subject.sleep(0.5)
    assert [subject.suspended_s(), subject.suspended_s()] == [1.5, 0.0]
