"""What a service prints: foreign text, such as a key of a configuration, cannot control the terminal."""

import logging

import pytest

from wire.host.command_line import EXIT_USAGE, log_to_stderr, refuse

ERASES_THE_SCREEN = "\x1b[2J"


def test_a_refusal_with_a_foreign_name_is_printable(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        refuse("supervisor", f"refused:\n  bus.{ERASES_THE_SCREEN}x: there is no such key")
    assert ended.value.code == EXIT_USAGE
    assert capsys.readouterr().err == "supervisor: refused:\n  bus.?[2Jx: there is no such key\n"


def test_a_log_line_with_a_foreign_name_is_printable(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(logging, "root", logging.RootLogger(logging.INFO))
    log_to_stderr()
    logging.root.warning("the record %s", ERASES_THE_SCREEN)
    assert capsys.readouterr().err.endswith(" WARNING root: the record ?[2J\n")
