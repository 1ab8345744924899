"""What the hub permits its clients."""

from typing import Any

import pytest

from wire.bus import BusError
from wire.messages import MAX_PAYLOAD_BYTES, encode, planar_twist
from wire.stamp import Stamper
from wire.zenoh import limits
from wire.zenoh.limits import hub_settings

ACCEPT, SESSIONS = "transport/unicast/accept_pending", "transport/unicast/max_sessions"


def counts(open_files: int) -> tuple[int, int]:
    """Return the permitted numbers of sessions and of pending connections."""
    settings: dict[str, Any] = hub_settings("robot", open_files)
    return settings[SESSIONS], settings[ACCEPT]


def test_with_enough_open_files_the_hub_permits_what_it_wants() -> None:
    assert counts(limits.WANTED_FILES) == (limits.MAX_SESSIONS, limits.MAX_PENDING)


@pytest.mark.parametrize("open_files", [300, 1024, 1500, 4096, limits.WANTED_FILES, 1 << 20])
def test_strangers_never_take_the_files_that_the_supervisor_needs(open_files: int) -> None:
    sessions, pending = counts(open_files)
    assert sessions >= 1
    assert pending >= 1
    assert sessions + pending + limits.RESERVED_FILES <= open_files


@pytest.mark.parametrize("open_files", [0, 64, 100, limits.NEEDED_FILES - 1])
def test_too_few_open_files_are_refused_with_the_number_that_is_needed(open_files: int) -> None:
    with pytest.raises(
        BusError, match=f"may open {open_files} files, but needs {limits.NEEDED_FILES} .*RLIMIT_NOFILE"
    ):
        counts(open_files)
    assert counts(limits.NEEDED_FILES) == (limits.MIN_SESSIONS, limits.MIN_SESSIONS)


def test_every_message_of_lifeline_passes_the_filters() -> None:
    assert limits.MESSAGE_BYTES > MAX_PAYLOAD_BYTES
    command = encode(planar_twist(0.5, 0.1)) + Stamper().next(None).pack()
    assert len(command) < limits.COMMAND_BYTES


def test_the_filter_of_commands_belongs_to_the_robots_namespace() -> None:
    settings: dict[str, Any] = hub_settings("robot7", 1024)
    rules = {rule["id"]: rule for rule in settings["low_pass_filter"]}
    assert rules["commands"]["key_exprs"] == ["robot7/*/cmd_vel"]
    assert all(rule["flows"] == ["ingress"] for rule in rules.values())
