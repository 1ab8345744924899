"""Chooses the topics of a recording that are judged: by type, by the names of Lifeline's wire, or as named. Pure."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from deploy.stack.errors import DeployError
from recordings.judge.source import Found
from wire import topics
from wire.message_types import EstopLease, SafetyStatus
from wire.ros import Bool, LaserScan, Odometry, Twist

TWIST_STAMPED = "geometry_msgs/msg/TwistStamped"
SCAN_TYPES = (LaserScan.__msgtype__,)
ODOM_TYPES = (Odometry.__msgtype__,)
ESTOP_TYPES = (Bool.__msgtype__,)
COMMAND_TYPES = (Twist.__msgtype__, TWIST_STAMPED)
MAX_NAMED = 8
"""Topics that a sentence names."""


@dataclass(frozen=True, slots=True)
class Named:
    """The topics that the operator names."""

    scans: tuple[str, ...] = ()
    odom: str | None = None
    cmd_vel: str | None = None
    estops: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Chosen:
    """The topics that are judged; None where the recording has none."""

    scans: tuple[str, ...]
    """In the order of the configuration's lidars."""
    odom: str | None
    cmd_vel: str | None
    status: str | None = None
    """The status of Lifeline's supervisor: the recording is of a supervised robot."""
    requests: Mapping[str, str] = field(default_factory=dict[str, str])
    """The source of each topic with requests to the supervisor."""
    estops: tuple[str, ...] = ()
    """The topics of e-stops, those of e-stop stations included."""

    def all(self) -> frozenset[str]:
        """Return the names of all these topics."""
        one = (self.odom, self.cmd_vel, self.status)
        several = (*self.scans, *self.requests, *self.estops)
        return frozenset((*(name for name in one if name is not None), *several))


def choose(path: Path, found: Mapping[str, Found], named: Named, lidars: Sequence[str]) -> Chosen:
    """Choose the topics of a recording.

    Args:
        path: of the recording, for messages.
        found: its topics.
        named: the topics that the operator names.
        lidars: the topics of the lidars in the configuration, below the namespace; empty without a configuration.

    Raises:
        DeployError: it has no scan and no command, a named topic is missing, or several would fit.
    """
    statuses = _of_types(found, (SafetyStatus.__msgtype__,))
    has_named = named != Named()
    ending = f"/{topics.STATUS.key}"
    if len(statuses) > 1 and not has_named:
        raise _several(
            path, "statuses of robots", statuses, "the topics of one with --scan, --odom and --cmd-vel"
        )
    if len(statuses) == 1 and not has_named and statuses[0].endswith(ending):
        return _own(found, statuses[0].removesuffix(ending), lidars)
    scans = _scans(path, found, named.scans, lidars)
    odom = _one(path, found, named.odom, ODOM_TYPES, "--odom", "odometry")
    cmd_vel = _one(path, found, named.cmd_vel, COMMAND_TYPES, "--cmd-vel", "commands")
    if not scans and (odom is None or cmd_vel is None):
        raise DeployError(
            f"{path} cannot be judged: it has no laser scan, and not both odometry and commands, as ROS 2 messages; it has {_list(found)}"
        )
    for name in named.estops:
        _check(path, found, name, ESTOP_TYPES, "--estop")
    return Chosen(scans, odom, cmd_vel, estops=named.estops)


def _own(found: Mapping[str, Found], namespace: str, lidars: Sequence[str]) -> Chosen:
    """Choose the topics of a robot that Lifeline supervised, by the names of the wire."""
    prefix = f"{namespace}/"
    keys = {name.removeprefix(prefix): name for name in found if name.startswith(prefix)}
    scans = [keys[topic] for topic in lidars if topic in keys]
    scans = scans or [name for name in keys.values() if found[name].msgtype in SCAN_TYPES]
    requests = {name: source for key, name in keys.items() if (source := topics.source_of(key)) is not None}
    estops = [
        name
        for key, name in keys.items()
        if (key == topics.ESTOP.key and found[name].msgtype == Bool.__msgtype__)
        or (key.endswith("/presence") and found[name].msgtype == EstopLease.__msgtype__)
    ]
    return Chosen(
        tuple(scans),
        keys.get(topics.ODOM.key),
        keys.get(topics.CMD_VEL.key),
        prefix + topics.STATUS.key,
        requests,
        tuple(estops),
    )


def _scans(
    path: Path, found: Mapping[str, Found], named: Sequence[str], lidars: Sequence[str]
) -> tuple[str, ...]:
    if named:
        for name in named:
            _check(path, found, name, SCAN_TYPES, "--scan")
        if len(set(named)) < len(named):
            raise DeployError("--scan names a topic twice: name one topic for each lidar")
        scans = list(named)
    else:
        scans = _of_types(found, SCAN_TYPES)
        by_lidar = [[name for name in scans if name.endswith(f"/{topic}")] for topic in lidars]
        if by_lidar and all(len(names) == 1 for names in by_lidar):
            return tuple(name for (name,) in by_lidar)
        if len(scans) > 1:
            order = ", in the order of the configuration's lidars" if len(lidars) > 1 else ""
            raise _several(path, "topics of laser scans", scans, f"one or more with --scan{order}")
    if scans and len(lidars) not in {0, len(scans)}:
        raise DeployError(
            f"the configuration has {len(lidars)} lidars ({', '.join(lidars)}), and {path} has {_list(scans)}: "
            "name a topic for each lidar with --scan, or another configuration"
        )
    return tuple(scans)


def _one(
    path: Path, found: Mapping[str, Found], named: str | None, types: Sequence[str], option: str, what: str
) -> str | None:
    if named is not None:
        _check(path, found, named, types, option)
        return named
    fitting = _of_types(found, types)
    if len(fitting) > 1:
        raise _several(path, f"topics of {what}", fitting, f"one with {option}")
    return fitting[0] if fitting else None


def _check(path: Path, found: Mapping[str, Found], name: str, types: Sequence[str], option: str) -> None:
    if name not in found:
        raise DeployError(
            f"{path} has no topic {name:.200} ({option}); it has {_list(_of_types(found, types) or found)}"
        )
    if found[name].msgtype not in types:
        raise DeployError(f"{option} {name}: it is a {found[name].msgtype:.200}, not a {' or '.join(types)}")


def _of_types(found: Mapping[str, Found], types: Sequence[str]) -> list[str]:
    return sorted(name for name, one in found.items() if one.msgtype in types and one.messages > 0)


def _several(path: Path, what: str, names: Sequence[str], how: str) -> DeployError:
    return DeployError(f"{path} has several {what}: {_list(names)}; name {how}")


def _list(names: Mapping[str, Found] | Sequence[str]) -> str:
    named = sorted(names)
    texts = [
        f"{name:.100} ({names[name].msgtype:.100})" if isinstance(names, Mapping) else f"{name:.100}"
        for name in named[:MAX_NAMED]
    ]
    more = [f"{len(named) - MAX_NAMED} more"] if len(named) > MAX_NAMED else []
    return ", ".join((*texts, *more)) or "no ROS 2 messages in CDR"
