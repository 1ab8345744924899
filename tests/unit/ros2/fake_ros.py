"""A ROS 2 node without ROS: tests set what discovery knows, and call its callbacks."""

from collections.abc import Callable

from ros2.ros import Endpoint, Level, Quality, Report
from ros2.samples import Sample
from wire.messages import DiagnosticArray, DiagnosticStatus, decode

NAME = "/lifeline"


def _no_match() -> None:
    """Do nothing."""


def _report(status: DiagnosticStatus) -> Report:
    values = tuple((value.key, value.value) for value in status.values)
    return Report(status.name.removeprefix("lifeline: "), Level(status.level), status.message, values)


class FakeRos:
    """Implements the Protocol `Ros`."""

    discovery = "discovery"

    def __init__(self) -> None:
        self.name = NAME
        self.listed: dict[str, list[Endpoint]] = {}
        """Publishers by topic."""
        self.listening: dict[str, list[Endpoint]] = {}
        """Subscriptions by topic."""
        self.problems: dict[str, str] = {}
        """Why messages were refused, by topic."""
        self.heard: dict[str, list[Callable[[Sample], None]]] = {}
        self.matched: Callable[[], None] = _no_match
        self.published: dict[str, list[bytes]] = {}
        self.on_publish: Callable[[str, bytes], None] = lambda _topic, _payload: None
        self.services: dict[str, Callable[[], tuple[bool, str]]] = {}
        self.arrays: list[list[Report]] = []
        self.statuses: list[Report] = []
        self.is_started = self.is_closed = False

    def start(self) -> None:
        self.is_started = True

    def subscribe(
        self,
        topic: str,
        type_name: str,
        heard: Callable[[Sample], None],
        matched: Callable[[], None],
        *,
        quality: Quality = Quality.BEST_EFFORT,
    ) -> None:
        assert not self.is_started
        self.heard.setdefault(topic, []).append(heard)
        self.matched = matched

    def publisher(self, topic: str, type_name: str, matched: Callable[[], None]) -> Callable[[bytes], None]:
        def publish(payload: bytes) -> None:
            self.on_publish(topic, payload)
            self.published.setdefault(topic, []).append(payload)
            if topic == "/diagnostics":
                self.arrays.append([_report(status) for status in decode(payload, DiagnosticArray).status])
            elif topic == "/lifeline/status":
                self.statuses.append(_report(decode(payload, DiagnosticStatus)))

        return publish

    def serve(self, name: str, handler: Callable[[], tuple[bool, str]]) -> None:
        self.services[name] = handler

    def publishers(self, topic: str) -> list[Endpoint]:
        return list(self.listed.get(topic, ()))

    def subscriptions(self, topic: str) -> list[Endpoint]:
        return list(self.listening.get(topic, ()))

    def problem(self, topic: str) -> str | None:
        return self.problems.get(topic)

    def close(self) -> None:
        self.is_closed = True

    # --- for tests

    def report(self, name: str) -> Report:
        """Return the newest report of a part."""
        return next(report for report in self.arrays[-1] if report.name == name)
