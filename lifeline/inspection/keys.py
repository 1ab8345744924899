"""Names of topics as users write them, and the types behind their keys (`lifeline topic type`). Pure."""

import re
from collections.abc import Iterator
from fnmatch import fnmatchcase
from glob import escape
from typing import Any

from deploy.stack.console import print_json
from deploy.stack.errors import DeployError
from deploy.stack.launch import Launch
from supervisor.config import SupervisorSection
from wire import topics
from wire.topics import Topic

SEGMENT = re.compile(r"[A-Za-z0-9_.\-]+")


def full_key(name: str, namespace: str) -> str:
    """Return the full key of a name: `cmd_vel`, `/robot/cmd_vel` and `robot/cmd_vel` are `robot/cmd_vel`.

    A name with a leading slash is absolute, as in ROS 2; any other name is relative to the namespace, unless it begins
    with it.
    """
    key = name.strip().strip("/")
    if name.strip().startswith("/") or key == namespace or key.startswith(f"{namespace}/"):
        return key
    return f"{namespace}/{key}"


def is_key(key: str) -> bool:
    """Return whether this is a key without wildcards that the commands accept."""
    return len(key) <= 255 and all(SEGMENT.fullmatch(part) for part in key.split("/"))


def checked_key(name: str, namespace: str) -> str:
    """Return the full key of a name.

    Raises:
        DeployError: it is not a key.
    """
    key = full_key(name, namespace)
    if not is_key(key):
        raise DeployError(f"{name!r} is not a key: use a name such as cmd_vel or /{namespace}/cmd_vel")
    return key


def by_full_key(namespace: str, config: SupervisorSection) -> dict[str, Topic[Any]]:
    """Return by full key all topics of a robot with this configuration."""
    return {f"{namespace}/{topic.key}": topic for topic in config.all_topics()}


def topic_of(key: str, namespace: str, known: dict[str, Topic[Any]]) -> Topic[Any] | None:
    """Return the topic of a full key; None if its type is unknown. Commands of unconfigured sources are Twists too."""
    if key in known:
        return known[key]
    relative = key.removeprefix(f"{namespace}/")
    source = topics.source_of(relative) if relative != key else None
    return None if source is None else topics.source_cmd_vel(source)


def show_type(launch: Launch, name: str, *, full: bool, as_json: bool) -> None:
    """Print the type of a topic, with `full` also its definition; the configuration names it, so nothing has to run.

    Raises:
        DeployError: it is not a topic of this robot, or the configuration is refused.
    """
    namespace = launch.bus.namespace
    key = checked_key(name, namespace)
    topic = topic_of(key, namespace, by_full_key(namespace, launch.section("supervisor", SupervisorSection)))
    if topic is None:
        raise DeployError(f"the type of {key} is unknown: it is not a topic of this robot")
    type_name, text = topic.type.__msgtype__, None
    if full:
        from wire.messages import definition  # noqa: PLC0415 - slow, and not needed for the name

        text = definition(type_name).text
    if as_json:
        print_json({"key": key, "type": type_name, "definition": text})
    else:
        print(type_name if text is None else f"{type_name}\n{text}")


def matches(expression: str, key: str) -> bool:
    """Return whether a Zenoh key expression matches a key; `**` stands for any number of parts, `*` for one.

    A foreign program may declare any expression: the time is at most quadratic in the lengths.
    """
    parts = key.split("/")
    reached = {0}
    """The numbers of parts that the expression so far may stand for."""
    for one in expression.split("/"):
        if one == "**":
            reached = {n for first in reached for n in _skipped(parts, first)}
        else:
            reached = {n + 1 for n in reached if n < len(parts) and _matches_part(one, parts[n])}
    return len(parts) in reached


def _skipped(parts: list[str], first: int) -> Iterator[int]:
    """Yield the numbers of parts after `**`, which stands for no part that begins with `@`."""
    yield first
    for n in range(first, len(parts)):
        if parts[n].startswith("@"):
            return
        yield n + 1


def _matches_part(expression: str, part: str) -> bool:
    if expression == "*":
        return not part.startswith("@")
    return fnmatchcase(part, "*".join(map(escape, expression.split("$*"))))
