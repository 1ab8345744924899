"""Finding the gamepad among input devices, in a simulated sysfs."""

import shutil
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop.gamepad.find import (
    Described,
    GamepadError,
    Needed,
    bits,
    describe,
    find_gamepad,
    find_sensors,
    list_devices,
)
from tests.unit.teleop.pads import DUALSHOCK4, LAYOUT, MOTION_SENSORS, TL, XBOX360, X, load_pad, sysfs_bits

NEEDED = Needed(LAYOUT.axes, LAYOUT.buttons, ("ABS_Y", "ABS_X", "BTN_TL", "BTN_TR"))
DEVICES = Path("/dev/input")


def find(sysfs: Path, wanted: str | None = None) -> Described:
    return find_gamepad(NEEDED, wanted, sysfs=sysfs)


@given(st.integers(0, 2**768 - 1))
def test_a_bitmap_is_read_as_it_was_written(bitmap: int) -> None:
    assert bits(sysfs_bits(bitmap)) == bitmap


def test_the_bitmap_of_a_real_kernel_is_understood() -> None:
    keys = bits("7cdb000000000000 0 0 0 0")  # an X-Box 360 pad's capabilities/key
    assert keys == load_pad(XBOX360).bitmaps[1]


@pytest.mark.parametrize("name", [XBOX360, DUALSHOCK4])
def test_the_only_pad_is_found_among_other_devices(tmp_path: Path, name: str) -> None:
    load_pad(MOTION_SENSORS).put_in_sysfs(tmp_path, "event9")
    load_pad(name).put_in_sysfs(tmp_path, "event10")
    (tmp_path / "mouse0").mkdir()
    assert find(tmp_path).path == DEVICES / "event10"


def test_without_a_pad_the_sentence_says_what_there_is(tmp_path: Path) -> None:
    load_pad(MOTION_SENSORS).put_in_sysfs(tmp_path, "event9")
    with pytest.raises(
        GamepadError, match=r"no gamepad .*BTN_TL.*plug it in.*event9 \(Sony .* Motion Sensors\)"
    ):
        find(tmp_path)


def test_without_any_device_the_sentence_says_so(tmp_path: Path) -> None:
    with pytest.raises(GamepadError, match=r"no gamepad .*plug it in; input devices found: none"):
        find(tmp_path / "there is no such directory")


def test_two_pads_are_not_chosen_from(tmp_path: Path) -> None:
    load_pad(XBOX360).put_in_sysfs(tmp_path, "event3")
    load_pad(DUALSHOCK4).put_in_sysfs(tmp_path, "event12")
    with pytest.raises(
        GamepadError, match=r"2 gamepads: name one .*event3 \(Microsoft.* or .*event12 \(Sony"
    ):
        find(tmp_path)


def test_a_named_device_is_taken_through_its_links(tmp_path: Path) -> None:
    load_pad(XBOX360).put_in_sysfs(tmp_path / "sys", "event3")
    load_pad(DUALSHOCK4).put_in_sysfs(tmp_path / "sys", "event12")
    file = tmp_path / "event12"
    file.touch()
    link = tmp_path / "by-id-event-joystick"
    link.symlink_to(file)
    assert find(tmp_path / "sys", str(link)).path == file


def test_a_named_device_that_is_not_there_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(
        GamepadError, match=r"no input device /dev/no/pad: plug the gamepad in, or name another"
    ):
        find(tmp_path, "/dev/no/pad")
    (tmp_path / "pad").symlink_to("pad")
    with pytest.raises(GamepadError, match=r"no input device .*/pad: plug the gamepad in"):
        find(tmp_path, str(tmp_path / "pad"))


def test_a_named_file_that_is_no_input_device_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(GamepadError, match="no input device /dev/null"):
        find(tmp_path, "/dev/null")


def test_a_named_device_that_is_no_pad_is_an_error(tmp_path: Path) -> None:
    load_pad(MOTION_SENSORS).put_in_sysfs(tmp_path / "sys", "event9")
    file = tmp_path / "event9"
    file.touch()
    with pytest.raises(GamepadError, match=r"Motion Sensors\) has not all of ABS_Y, ABS_X, BTN_TL, BTN_TR"):
        find(tmp_path / "sys", str(file))


def test_a_device_that_goes_away_meanwhile_is_left_out(tmp_path: Path) -> None:
    load_pad(XBOX360).put_in_sysfs(tmp_path, "event3")
    load_pad(DUALSHOCK4).put_in_sysfs(tmp_path, "event4")
    shutil.rmtree(tmp_path / "event3" / "device" / "capabilities")
    assert [device.path.name for device in list_devices(DEVICES, tmp_path)] == ["event4"]


def test_a_name_cannot_speak_to_the_terminal(tmp_path: Path) -> None:
    load_pad(XBOX360).put_in_sysfs(tmp_path, "event3")
    (tmp_path / "event3" / "device" / "name").write_bytes(b"pad\x1b[2J\xff\n")
    assert describe(DEVICES / "event3", tmp_path).name == "pad?[2J?"


def test_the_motion_sensors_are_those_of_the_same_pad(tmp_path: Path) -> None:
    load_pad(MOTION_SENSORS).put_in_sysfs(tmp_path, "event4", uniq="another", phys="same adapter")
    load_pad(DUALSHOCK4).put_in_sysfs(tmp_path, "event5", uniq="mine", phys="same adapter")
    pad = find(tmp_path)
    assert find_sensors(pad, sysfs=tmp_path) is None
    load_pad(MOTION_SENSORS).put_in_sysfs(tmp_path, "event6", uniq="mine", phys="same adapter")
    sensors = find_sensors(pad, sysfs=tmp_path)
    assert sensors is not None
    assert sensors.path == DEVICES / "event6"


def test_a_pad_without_an_address_has_no_sensors_that_are_known_to_be_its_own(tmp_path: Path) -> None:
    load_pad(DUALSHOCK4).put_in_sysfs(tmp_path, "event5", phys="")
    load_pad(MOTION_SENSORS).put_in_sysfs(tmp_path, "event6", phys="")
    assert find_sensors(find(tmp_path), sysfs=tmp_path) is None


def test_what_is_needed_is_axes_and_buttons(tmp_path: Path) -> None:
    device = Described(DEVICES / "event1", "half a pad", ("", ""), 0, 0, 0)
    assert device.has(Needed((), (), ()))
    assert not device._replace(buttons=1 << TL).has(Needed((X,), (TL,), ()))
    assert not device._replace(axes=1 << X).has(Needed((X,), (TL,), ()))
    assert device._replace(axes=1 << X, buttons=1 << TL).has(Needed((X,), (TL,), ()))
