"""Layout files: what they may say, and the sentence for what they may not."""

from pathlib import Path

import pytest

from sim.layout import LAYOUTS, LayoutError, known, read_layout
from sim.movers import MoverKind

MINIMAL = "[hall]\nsize_m = [8.0, 6.0]\n"
WALKER = (
    '[[movers]]\nname = "ann"\nkind = "person"\nspeed_m_s = 1.0\nwaypoints_m = [[0.0, 1.0], [2.0, 1.0]]\n'
)


def _read(tmp_path: Path, text: str) -> object:
    path = tmp_path / "yard.toml"
    path.write_text(text)
    return read_layout(path)


def test_three_layouts_come_with_the_simulation_and_can_be_read() -> None:
    assert known() == ["aisle", "empty", "warehouse"]
    for name in known():
        layout = read_layout(LAYOUTS / f"{name}.toml")
        assert layout.movers, "someone is about in each"


def test_a_hall_is_all_that_a_layout_needs(tmp_path: Path) -> None:
    layout = _read(tmp_path, MINIMAL)
    assert layout == read_layout(tmp_path / "yard.toml")


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "hall is missing"),
        ("hall =", "not TOML"),
        (MINIMAL + "[roof]\n", "roof: there is no such key"),
        (MINIMAL + "[[pallets]]\nx_m = 1.0\ny_m = 1.0\nlod = 3\n", "pallets.0.lod: there is no such key"),
        (MINIMAL + '[[pallets]]\nx_m = 1.0\ny_m = 1.0\nload = "gold"\n', "pallets.0.load = 'gold'"),
        (MINIMAL + "[[barrels]]\nx_m = nan\ny_m = 1.0\n", "barrels.0.x_m = nan"),
        (MINIMAL + '[[racks]]\nname = "a"\nx_m = 1.0\ny_m = 1.0\nbays = 0\n', "racks.0.bays = 0"),
        (MINIMAL + '[start]\nx_m = "west"\n', "start.x_m = 'west'"),
        (MINIMAL + WALKER + WALKER, "two things are named 'ann'"),
        (MINIMAL + WALKER.replace("1.0\nway", "-1.0\nway"), "movers.0.speed_m_s = -1.0"),
        (MINIMAL + WALKER.replace("1.0\nway", "0.0\nway"), "movers.0.speed_m_s = 0.0"),
        (MINIMAL + WALKER.replace("1.0\nway", "inf\nway"), "movers.0.speed_m_s = inf"),
        (MINIMAL + WALKER.replace(", [2.0, 1.0]", ""), "movers.0.waypoints_m = [[0.0, 1.0]]"),
        (MINIMAL + WALKER.replace("2.0, 1.0", "nan, 1.0"), "movers.0.waypoints_m.1.0 = nan"),
        (MINIMAL + WALKER + "dwell_s = -1.0\n", "movers.0.dwell_s = -1.0"),
        (MINIMAL + WALKER + "dwell_s = nan\n", "movers.0.dwell_s = nan"),
        (MINIMAL + WALKER.replace("[2.0, 1.0]", "[0.0, 1.0]"), "at the same place"),
        (MINIMAL + WALKER.replace("person", "dragon"), "movers.0.kind = 'dragon'"),
        (MINIMAL.replace("8.0", "-8.0"), "hall.size_m.0 = -8.0"),
    ],
)
def test_a_fault_is_named_with_its_key_and_value(tmp_path: Path, text: str, why: str) -> None:
    with pytest.raises(LayoutError) as refused:
        _read(tmp_path, text)
    assert why in str(refused.value)


def test_a_layout_may_begin_with_a_byte_order_mark(tmp_path: Path) -> None:
    path = tmp_path / "yard.toml"
    path.write_bytes(b"\xef\xbb\xbf" + (LAYOUTS / "warehouse.toml").read_bytes())
    assert read_layout(path) == read_layout(LAYOUTS / "warehouse.toml")


def test_all_faults_are_named_at_once(tmp_path: Path) -> None:
    with pytest.raises(LayoutError, match=r"hall is missing; roof: there is no such key"):
        _read(tmp_path, "roof = 1\n")


def test_a_file_that_is_not_there_is_said_so(tmp_path: Path) -> None:
    with pytest.raises(LayoutError, match="cannot be read: No such file"):
        read_layout(tmp_path / "nowhere.toml")


def test_a_mover_yields_by_its_kind_unless_told_otherwise(tmp_path: Path) -> None:
    def yields_m(text: str) -> float | None:
        layout = read_layout(_written(tmp_path, MINIMAL + WALKER + text))
        return layout.movers[0].mover().yields_m

    assert yields_m("") == 0.45
    assert yields_m("yields_m = 1.2\n") == 1.2
    assert yields_m("yields = false\n") is None


def test_forklifts_back_up_and_people_turn_round(tmp_path: Path) -> None:
    for kind in MoverKind:
        layout = read_layout(_written(tmp_path, MINIMAL + WALKER.replace("person", kind)))
        assert layout.movers[0].mover().way.backs_up == (kind is MoverKind.FORKLIFT)


def _written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "yard.toml"
    path.write_text(text)
    return path
