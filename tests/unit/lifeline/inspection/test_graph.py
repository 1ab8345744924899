"""The graph of nodes and keys."""

import math
import xml.etree.ElementTree as ET

from lifeline.inspection.graph import Wire, dot_of, svg_of, text_of, wires_of
from lifeline.inspection.nodes import Node
from lifeline.inspection.traffic import Traffic
from wire.bus import Overheard
from wire.zenoh.network import Session


def node(name: str, writes: str = "", reads: str = "") -> Node:
    session = Session(name, "", frozenset(writes.split()), frozenset(reads.split()))
    return Node(name, is_named=True, session=session, process=None, host="local")


NODES = [
    node("supervisor", "robot/cmd_vel", "robot/*/cmd_vel robot/scan"),
    node("sim", "robot/scan", "robot/cmd_vel"),
    node("teleop", "robot/teleop/cmd_vel"),
]
NAMES = [one.name for one in NODES]


def traffic(*keys: str) -> Traffic:
    heard = Traffic()
    for key in keys:
        for n in range(3):
            heard.add(Overheard(key, b"", None, 0.05 * n))
    return heard


def test_each_key_has_a_wire_from_its_writer_to_its_readers() -> None:
    wires = wires_of(NODES, traffic("robot/scan", "robot/foreign"), "robot")
    assert [(wire.key, wire.writer, wire.readers) for wire in wires] == [
        ("cmd_vel", 0, (1,)),
        ("scan", 1, (0,)),
        ("teleop/cmd_vel", 2, (0,)),
        ("foreign", None, ()),
    ]
    assert wires[1].label == "scan  20.0 Hz"
    assert math.isnan(wires[0].rate_hz)


def test_two_writers_of_a_key_are_two_wires() -> None:
    nodes = [*NODES, node("spoof", "robot/scan")]
    assert [wire.writer for wire in wires_of(nodes, traffic(), "robot") if wire.key == "scan"] == [1, 3]


def test_the_text_has_an_arrow_at_each_reader() -> None:
    wires = wires_of(NODES, traffic("robot/scan"), "robot")
    head, lanes, cmd_vel, scan, teleop = text_of(NAMES, wires).splitlines()
    assert head.split() == NAMES
    assert lanes.count("│") == 3
    assert cmd_vel.index("●") < cmd_vel.index("►│")
    assert "│◄" in scan
    assert teleop.index("│◄") < teleop.index("┼") < teleop.index("●")


def test_a_key_that_nobody_reads_is_a_dot_on_its_lane() -> None:
    assert "○" in text_of(["a"], [Wire("x", 0, (), math.nan)])


def test_no_name_can_control_the_terminal_or_break_the_drawings() -> None:
    nodes = [node('<&"\x1b[2J', "robot/a")]
    names = [one.name for one in nodes]
    wires = [Wire('k"<&', 0, (), 1.0)]
    assert "\x1b" not in text_of(names, wires)
    assert "\x1b" not in dot_of(names, wires)
    root = ET.fromstring(svg_of(names, wires, "t<"))
    assert 'k"<&  1.0 Hz' in "".join(root.itertext())


def test_an_empty_network_has_an_empty_drawing() -> None:
    assert text_of([], []).strip() == ""
    ET.fromstring(svg_of([], [], ""))


def test_the_graphviz_file_has_an_edge_for_each_writer_and_reader() -> None:
    text = dot_of(NAMES, wires_of(NODES, traffic(), "robot"))
    assert text.count("->") == 6
    assert text.startswith("digraph")
