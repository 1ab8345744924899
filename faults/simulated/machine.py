"""What outlives a virtual supervisor's process: its machine's clocks, and its record of a pressed e-stop.

A supervisor that does not take the one or the other is run without it, and does not keep the promises that need it.
"""

import importlib
import inspect
from typing import Any

from supervisor.service import SupervisorService

RECORD, SUSPEND = "estop_record", "suspended_s"
TAKES = frozenset(inspect.signature(SupervisorService).parameters)
"""The parameters that the supervisor's constructor accepts."""


class Machine:
    """One machine, which outlives its supervisor processes."""

    def __init__(self) -> None:
        self._slept_s = 0.0
        record = importlib.import_module("supervisor.estop_record") if RECORD in TAKES else None
        self._record: Any = None if record is None else record.MemoryRecord()

    def sleep(self, duration_s: float) -> None:
        """Suspend the machine: time passes, but the monotonic clock does not advance."""
        self._slept_s += duration_s

    def suspended_s(self) -> float:
        """Return the suspended time since the last call [s]."""
        slept_s, self._slept_s = self._slept_s, 0.0
        return slept_s

    def options(self) -> dict[str, Any]:
        """Return the arguments for `SupervisorService` that its constructor accepts."""
        options: dict[str, Any] = {RECORD: self._record, SUSPEND: self.suspended_s}
        return {name: value for name, value in options.items() if name in TAKES}
