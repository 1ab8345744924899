"""The interface between the service and ROS 2. All messages are CDR bytes."""

from collections.abc import Callable
from enum import Enum, IntEnum, auto
from typing import NamedTuple, Protocol

from ros2.samples import Sample

TWIST, TWIST_STAMPED = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"
LASER_SCAN, ODOMETRY, BOOL = "sensor_msgs/msg/LaserScan", "nav_msgs/msg/Odometry", "std_msgs/msg/Bool"
DIAGNOSTIC_ARRAY = "diagnostic_msgs/msg/DiagnosticArray"
DIAGNOSTIC_STATUS = "diagnostic_msgs/msg/DiagnosticStatus"


def twist_type(*, stamped: bool) -> str:
    return TWIST_STAMPED if stamped else TWIST


class Endpoint(NamedTuple):
    """A publisher or a subscription of any node."""

    node: str
    """Full name of its node."""
    type_name: str
    """Such as `geometry_msgs/msg/Twist`."""
    gid: bytes
    """Its identity (16 bytes): that of DDS, or with rmw_zenoh a hash of its token."""
    is_transient: bool = False
    """Whether a subscription requests, or a publisher offers, messages from before the match (transient local)."""


class Level(IntEnum):
    """The levels of `diagnostic_msgs/msg/DiagnosticStatus`."""

    OK = 0
    WARN = 1
    ERROR = 2


class Report(NamedTuple):
    """The state of one part."""

    name: str
    level: Level
    message: str
    values: tuple[tuple[str, str], ...] = ()


class Quality(Enum):
    """What a subscription requests, and from which publishers it therefore receives."""

    BEST_EFFORT = auto()
    """From every publisher, and never an old message."""
    RELIABLE = auto()
    """From reliable publishers, again if a message is lost."""
    LATCHED = auto()
    """From transient local publishers, also their last message from before the match."""


class Ros(Protocol):
    """One node. Its callbacks run on threads of its own, and must not block."""

    @property
    def name(self) -> str:
        """Full name of the node."""
        ...

    @property
    def discovery(self) -> str:
        """What shows the end of another program's endpoints, for the reports."""
        ...

    def start(self) -> None:
        """Begin to receive; call it after all declarations."""
        ...

    def subscribe(
        self,
        topic: str,
        type_name: str,
        heard: Callable[[Sample], None],
        matched: Callable[[], None],
        *,
        quality: Quality = Quality.BEST_EFFORT,
    ) -> None:
        """Call `heard` for each message, and `matched` when a publisher appears or disappears."""
        ...

    def publisher(self, topic: str, type_name: str, matched: Callable[[], None]) -> Callable[[bytes], None]:
        """Return a function that publishes a message without waiting.

        `matched` is called when a subscription appears or disappears.
        """
        ...

    def serve(self, name: str, handler: Callable[[], tuple[bool, str]]) -> None:
        """Answer a `std_srvs/srv/Trigger` service; the handler may wait."""
        ...

    def publishers(self, topic: str) -> list[Endpoint]:
        """Return all publishers of a topic, this node's included."""
        ...

    def subscriptions(self, topic: str) -> list[Endpoint]:
        """Return all subscriptions of a topic, this node's included."""
        ...

    def problem(self, topic: str) -> str | None:
        """Return a sentence if messages of a topic were refused lately; None if none was."""
        ...

    def close(self) -> None:
        """Leave the domain, so that other nodes notice it at once."""
        ...
