"""State that survives a virtual supervisor's process."""

import pytest

from faults.simulated import machine
from faults.simulated.machine import RECORD, SUSPEND, Machine


def test_a_sleep_is_told_once_and_several_add_up() -> None:
    subject = Machine()
    subject.sleep(1.0)
    subject.sleep(0.5)
    assert [subject.suspended_s(), subject.suspended_s()] == [1.5, 0.0]


def test_a_supervisor_is_given_what_it_takes_and_no_more(monkeypatch: pytest.MonkeyPatch) -> None:
    assert set(Machine().options()) == machine.TAKES & {RECORD, SUSPEND}
    monkeypatch.setattr(machine, "TAKES", frozenset({SUSPEND}))
    subject = Machine()
    assert subject.options() == {SUSPEND: subject.suspended_s}
