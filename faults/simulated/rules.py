"""Judges every step of a simulated supervisor by the rules of `lifeline judge`, which do not know the law."""

from faults.trial import BrokenPromise
from recordings.judge.monitors import Estop, FreshCommand, Monitors, NeutralFirst, SameStep
from recordings.judge.own import events_of_step
from supervisor.law.decision import Decision
from supervisor.law.model import Inputs
from supervisor.law.state import State

PROMISE_OF = {SameStep.rule: 1, Estop.rule: 1, FreshCommand.rule: 3, NeutralFirst.rule: 7}
"""The promise that a broken rule breaks."""


class RuleJudge:
    """Takes the place of a supervisor's black box.

    Args:
        command_timeout_s: maximum age of a command.
        broken: receives the broken promises.
    """

    def __init__(self, command_timeout_s: float, broken: list[BrokenPromise]) -> None:
        self._monitors = Monitors(command_timeout_s)
        self._broken = broken

    def record(self, now_s: float, inputs: Inputs, state: State, decision: Decision) -> None:  # noqa: ARG002 - as a black box
        for event in events_of_step(now_s, inputs, decision):
            for violation in self._monitors.hear(event):
                sentence = f"{violation.rule}: {violation.sentence}"
                self._broken.append(BrokenPromise(PROMISE_OF[violation.rule], violation.time_s, sentence))

    def close(self) -> None:
        """Do nothing: there is no file."""
