"""Nodes that use the keys of rmw_zenoh: their names, and bounds against floods."""

import pytest

from supervisor.messages import MAX_NAME_LENGTH, MAX_NAMES, MAX_TOKENS, ForeignNodes


def token(name: str, namespace: str = "%", session: str = "aa11") -> str:
    """As rmw_zenoh_cpp and zenoh-ros2-sdk declare it."""
    return f"@ros2_lv/0/{session}/0/0/NN/%/{namespace}/{name}"


def heard(*tokens: str) -> ForeignNodes:
    nodes = ForeignNodes()
    for one in tokens:
        nodes.change(one, alive=True)
    return nodes


@pytest.mark.parametrize(
    ("namespace", "name"),
    [("%", "/talker"), ("%robot", "/robot/talker"), ("%robot%arm", "/robot/arm/talker")],
)
def test_a_node_is_named_with_its_namespace(namespace: str, name: str) -> None:
    assert heard(token("talker", namespace)).names() == [name]


def test_nobody_is_named_without_a_token() -> None:
    assert ForeignNodes().names() == []


def test_a_node_disappears_with_its_token() -> None:
    nodes = heard(token("talker"), token("listener"))
    nodes.change(token("talker"), alive=False)
    nodes.change(token("never seen"), alive=False)
    assert nodes.names() == ["/listener"]


def test_two_nodes_of_one_name_are_named_once_and_until_both_are_gone() -> None:
    nodes = heard(token("talker", session="aa"), token("talker", session="bb"))
    assert nodes.names() == ["/talker"]
    nodes.change(token("talker", session="aa"), alive=False)
    assert nodes.names() == ["/talker"]
    nodes.change(token("talker", session="bb"), alive=False)
    assert nodes.names() == []


@pytest.mark.parametrize(
    "key", ["", "@ros2_lv", "robot/alive/teleop", f"{token('a')}/b", "@ros2_lv/0/a/0/0/NN/%/%"]
)
def test_a_token_with_another_layout_names_nobody(key: str) -> None:
    assert heard(key).names() == []


def test_beyond_the_maximum_the_others_are_counted() -> None:
    names = [f"node{n:03}" for n in range(MAX_NAMES + 2)]
    assert heard(*map(token, names[:MAX_NAMES])).names() == [f"/{name}" for name in names[:MAX_NAMES]]
    assert heard(*map(token, names)).names() == [*(f"/{name}" for name in names[:MAX_NAMES]), "and 2 more"]


def test_a_flood_of_tokens_is_bounded_and_ends_with_them() -> None:
    flood = [token(f"n{n:06}") for n in range(10 * MAX_TOKENS)]
    nodes = heard(*flood)
    assert nodes.names()[-1] == f"and {MAX_TOKENS - MAX_NAMES} more"
    for one in flood:
        nodes.change(one, alive=False)
    assert nodes.names() == []


def test_a_long_name_is_cut() -> None:
    assert heard(token("x" * 1000)).names() == ["/" + "x" * (MAX_NAME_LENGTH - 1)]
