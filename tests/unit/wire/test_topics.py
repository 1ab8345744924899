"""The keys of additional lidars: any except the other keys of the wire."""

import pytest

from wire import topics


def test_the_first_lidar_is_on_scan() -> None:
    assert topics.lidar_scan("scan") is topics.SCAN


@pytest.mark.parametrize("topic", ["scan_rear", "rear/scan", "scan2", "s" * 64])
def test_another_lidar_has_a_key_of_its_own(topic: str) -> None:
    found = topics.lidar_scan(topic)
    assert (found.key, found.type, found.writer) == (topic, topics.SCAN.type, topics.SCAN.writer)


@pytest.mark.parametrize(
    "topic",
    ["", "/scan", "scan/", "a//b", "Scan", "scan rear", "scan*", "**", "<lidar>", "1scan", "s" * 65],
)
def test_what_is_no_relative_key_is_refused(topic: str) -> None:
    with pytest.raises(ValueError, match="relative key"):
        topics.lidar_scan(topic)


@pytest.mark.parametrize(
    "topic",
    [
        *(
            entry.key
            for entry in (*topics.TOPICS, *topics.SERVICES)
            if "<" not in entry.key and entry.key != "scan"
        ),
        topics.source_cmd_vel("rear").key,
        topics.source_holder("rear").key,
        topics.alive("rear"),
        "supervisor/scan",
        "sim/scan",
    ],
)
def test_a_key_that_is_something_else_s_is_refused(topic: str) -> None:
    with pytest.raises(ValueError, match="already used"):
        topics.lidar_scan(topic)


@pytest.mark.parametrize("epoch", [b"", b"\x00", b"sixteen bytes..."])
def test_a_token_names_its_node_and_its_run(epoch: bytes) -> None:
    key = topics.alive("teleop", epoch)
    assert topics.token_of(key.removeprefix(topics.alive(""))) == ("teleop", epoch)


@pytest.mark.parametrize(
    "text", ["teleop/", "teleop/xy", "teleop/abc", "teleop/AB", "teleop/ab/cd", f"a/{'00' * 17}"]
)
def test_a_token_of_another_form_is_no_token_of_a_run(text: str) -> None:
    assert topics.token_of(text) is None
