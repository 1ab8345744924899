"""The layout for Foxglove: each panel is placed once, and shows topics and fields that exist."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import deploy
from lifeline.inspection.values import plain_value, select
from wire import topics
from wire.messages import Message, SafetyStatus, header, odometry

LAYOUT = json.loads((Path(deploy.__file__).parent / "examples" / "foxglove-layout.json").read_text())
MESSAGES: dict[str, Message] = {
    f"/robot/{topics.STATUS.key}": SafetyStatus(header("")),
    f"/robot/{topics.ODOM.key}": odometry((0.0, 0.0, 0.0), (0.0, 0.0)),
}
PATHS = [path["value"] for panel in LAYOUT["configById"].values() for path in panel.get("paths", [])]


def placed(node: Any) -> Iterator[str]:  # noqa: ANN401 - a panel or a split
    if isinstance(node, str):
        yield node
    else:
        assert node["direction"] in ("row", "column")
        assert 0 < node["splitPercentage"] < 100
        yield from (*placed(node["first"]), *placed(node["second"]))


def test_each_panel_is_configured_and_placed_once() -> None:
    assert set(LAYOUT) == {"configById", "globalVariables", "userNodes", "playbackConfig", "layout"}
    assert sorted(placed(LAYOUT["layout"])) == sorted(LAYOUT["configById"])


def test_the_3d_panel_and_the_raw_messages_show_topics_that_are_served() -> None:
    served = {f"/robot/{topic.key}" for topic in topics.TOPICS} | {"/tf", "/scene"}
    assert set(LAYOUT["configById"]["3D!robot"]["topics"]) <= served
    assert LAYOUT["configById"]["RawMessages!status"]["topicPath"] in served


@pytest.mark.parametrize("path", PATHS)
def test_each_plotted_field_exists(path: str) -> None:
    topic, _, field = path.partition(".")
    assert isinstance(select(plain_value(MESSAGES[topic]), field), (float, int, str))
