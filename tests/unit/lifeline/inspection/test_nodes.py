"""The hub's report, and the nodes in it."""

import json

from hypothesis import given
from hypothesis import strategies as st

from lifeline.inspection.nodes import Node, addresses, describe, find, nodes_of, program
from lifeline.inspection.sockets import Process
from wire.zenoh.network import Network, Session, network_of

HUB, SIM, STRANGER = "aa11", "bb22", "cc33dd44ee"
ENDPOINT = "tcp/127.0.0.1:7447"


def entry(*clients: str, peers: tuple[str, ...] = ()) -> bytes:
    return json.dumps({"routers": [], "peers": list(peers), "clients": list(clients)}).encode()


def link(session_id: str, port: int) -> dict[str, object]:
    return {
        "peer": session_id,
        "links": [{"src": "tcp/127.0.0.1:7447", "dst": f"tcp/127.0.0.1:{port}"}],
    }


REPORT = {
    f"@/{HUB}/peer": json.dumps(
        {"locators": ["tcp/127.0.0.1:7447"], "sessions": [link(SIM, 4001), link(STRANGER, 4002)]}
    ).encode(),
    f"@/{HUB}/peer/publisher/robot/cmd_vel": entry(HUB),
    f"@/{HUB}/peer/publisher/robot/scan": entry(SIM, STRANGER),
    f"@/{HUB}/peer/subscriber/robot/scan": entry(HUB, peers=(HUB,)),
    f"@/{HUB}/peer/subscriber/robot/cmd_vel": entry(SIM, peers=(HUB,)),
    f"@/{HUB}/peer/queryable/robot/sim/reset": entry(SIM, peers=(HUB,)),
    f"@/{HUB}/peer/token/robot/alive/sim": entry(SIM, peers=(HUB,)),
    f"@/{HUB}/peer/token/robot/alive/supervisor": entry(HUB),
    f"@/{SIM}/session/transport/unicast/{HUB}": b'{"zid": "aa11"}',
    f"@/{HUB}/peer/metrics": b"\x1f\x8b\x00",
}
ADDRESSES = {
    "127.0.0.1:7447": Process(10, ("python", "-m", "supervisor"), 9.0),
    "127.0.0.1:4001": Process(11, ("/x/.venv/bin/python", "-m", "sim", "--seed", "1"), 8.0),
    "127.0.0.1:4002": Process(12, ("python3", "/tmp/spoof.py"), 1.0),
}


def nodes() -> list[Node]:
    return nodes_of(network_of(REPORT), ADDRESSES, "robot", ENDPOINT)


def test_each_session_has_what_it_declares() -> None:
    network = network_of(REPORT)
    assert network.hub == HUB
    hub, sim, stranger = network.sessions
    assert hub == Session(
        HUB,
        "",
        frozenset({"robot/cmd_vel"}),
        frozenset({"robot/scan"}),
        frozenset(),
        frozenset({"robot/alive/supervisor"}),
    )
    assert (sim.address, sim.serves) == ("127.0.0.1:4001", frozenset({"robot/sim/reset"}))
    assert (stranger.writes, stranger.reads) == (frozenset({"robot/scan"}), frozenset())


def test_a_node_has_the_name_of_its_token_else_of_its_program() -> None:
    assert [(node.name, node.is_named, node.pid) for node in nodes()] == [
        ("supervisor", True, 10),
        ("sim", True, 11),
        ("spoof.py", False, 12),
    ]
    assert describe(nodes()[1]) == "sim, pid 11"


def test_a_node_on_another_machine_has_an_address_and_no_process() -> None:
    stranger = nodes_of(network_of(REPORT), {}, "robot", ENDPOINT)[2]
    assert (stranger.name, stranger.pid, stranger.host) == ("cc33dd44", None, "127.0.0.1")
    assert "127.0.0.1:4002" in describe(stranger)


def test_the_token_of_a_candidate_for_a_name_is_not_a_name() -> None:
    report = REPORT | {f"@/{HUB}/peer/token/robot/alive/teleop.1234": entry(STRANGER)}
    assert not nodes_of(network_of(report), ADDRESSES, "robot", ENDPOINT)[2].is_named


def test_the_own_session_can_be_left_out() -> None:
    assert len(nodes_of(network_of(REPORT), ADDRESSES, "robot", ENDPOINT, own_id=STRANGER)) == 2


def test_nodes_are_found_by_name_pid_and_beginning_of_their_session() -> None:
    for wanted in ("sim", "/sim", "11", "bb22"):
        assert [node.name for node in find(nodes(), wanted)] == ["sim"]
    assert find(nodes(), "bb") == []


def test_the_processes_of_all_clients_and_of_the_hub_are_wanted() -> None:
    assert addresses(network_of(REPORT), ENDPOINT) == set(ADDRESSES)


def test_a_report_without_a_hub_has_no_sessions() -> None:
    assert network_of({}) == Network("", ())


@given(
    st.dictionaries(
        st.sampled_from(list(REPORT)),
        st.one_of(
            st.binary(max_size=40),
            st.recursive(
                st.none() | st.integers() | st.text(max_size=5),
                lambda inner: (
                    st.lists(inner, max_size=3)
                    | st.dictionaries(
                        st.sampled_from(["sessions", "links", "peer", "locators", "clients"]), inner
                    )
                ),
                max_leaves=8,
            ).map(lambda value: json.dumps(value).encode()),
        ),
    )
)
def test_no_report_is_an_error(damaged: dict[str, bytes]) -> None:
    nodes_of(network_of(REPORT | damaged), ADDRESSES, "robot", ENDPOINT)


def test_the_short_name_of_a_program_is_its_module_script_or_command() -> None:
    for arguments, name in (
        (("python", "-m", "sim", "--seed", "1"), "sim"),
        (("python", "-m", "lifeline.cli.app", "topic", "echo", "scan"), "lifeline topic echo"),
        (("/x/bin/python", "/x/bin/lifeline", "status", "--json"), "lifeline status"),
        (("python3.11", "-u", "/tmp/spoof.py", "7447"), "spoof.py"),
        (("/opt/bridge",), "bridge"),
        ((), ""),
    ):
        assert program(arguments) == name


def test_a_report_of_deep_lists_is_ignored() -> None:
    assert network_of({"@/zzz/peer": b"[" * 200_000, **REPORT}) == network_of(REPORT)
