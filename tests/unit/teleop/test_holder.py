"""The description of a source name's holder."""

import getpass
import os

import pytest

from teleop.holder import about_this_process


def test_it_names_the_person_the_machine_and_the_process() -> None:
    about = about_this_process("joy")
    assert about.startswith(f"the joy of {getpass.getuser()}@{os.uname().nodename}, pid {os.getpid()}")


def test_a_user_id_without_a_name_is_reported_as_such(monkeypatch: pytest.MonkeyPatch) -> None:
    def nobody() -> str:
        raise KeyError("getpwuid(): uid not found")

    monkeypatch.setattr(getpass, "getuser", nobody)
    assert f"the teleop of user {os.getuid()}@" in about_this_process("teleop")
