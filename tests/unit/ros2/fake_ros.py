"""A ROS 2 node without ROS: tests set what discovery knows, and call its callbacks."""

from collections.abc import Callable, Sequence

from ros2.diagnostics import Report
from ros2.endpoints import Endpoint
from ros2.ros import Quality
from ros2.samples import Sample

NAME = "/lifeline"


def _no_match() -> None:
    """Do nothing."""


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

        return publish

    def serve(self, name: str, handler: Callable[[], tuple[bool, str]]) -> None:
        self.services[name] = handler

    def publishers(self, topic: str) -> list[Endpoint]:
        return list(self.listed.get(topic, ()))

    def subscriptions(self, topic: str) -> list[Endpoint]:
        return list(self.listening.get(topic, ()))

    def problem(self, topic: str) -> str | None:
        return self.problems.get(topic)

    def encode_array(self, reports: Sequence[Report]) -> bytes:
        self.arrays.append(list(reports))
        return b"array"

    def encode_status(self, report: Report) -> bytes:
        self.statuses.append(report)
        return b"status"

    def close(self) -> None:
        self.is_closed = True

    # --- for tests

    def report(self, name: str) -> Report:
        """Return the newest report of a part."""
        return next(report for report in self.arrays[-1] if report.name == name)
