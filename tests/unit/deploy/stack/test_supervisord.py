"""A supervisord that does not answer."""

import gc
import socket
import threading
from pathlib import Path

import pytest

from deploy.stack import supervisord
from deploy.stack.errors import DeployError
from deploy.stack.launch import Launch
from deploy.stack.statedir import StateDir


def test_one_that_does_not_answer_has_no_programs_starts_none_and_leaves_no_socket_open(
    tmp_path: Path,
) -> None:
    state = StateDir(tmp_path)
    with socket.socket(socket.AF_UNIX) as dead:
        dead.bind(str(state.socket))
    assert supervisord.programs(state) is None
    assert not supervisord.stop_program(state, "supervisor")
    assert not supervisord.start_program(state, "supervisor")
    gc.collect()  # collecting an open socket raises a warning, which fails the test


def test_one_whose_answer_is_no_xml_has_no_programs(tmp_path: Path) -> None:
    """The daemon writes the name of its state directory without escaping control characters."""
    state = StateDir(tmp_path)
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(state.socket))
        server.listen()

        def answer() -> None:
            connection, _ = server.accept()
            with connection:
                connection.recv(65_536)
                connection.sendall(b"HTTP/1.0 200 OK\r\nContent-Type: text/xml\r\n\r\n<a>\x1b[2J</a>")

        answering = threading.Thread(target=answer)
        answering.start()
        assert supervisord.programs(state) is None
        answering.join()


@pytest.mark.parametrize("name", ["100%(x)s", "a%b", "a\nb", "a\x1b[2Jb"])
def test_a_state_directory_that_it_cannot_use_is_refused_in_one_printable_sentence(
    name: str, tmp_path: Path
) -> None:
    with pytest.raises(DeployError, match="choose another directory") as refused:
        supervisord.start("uv", StateDir(tmp_path / name), Launch.read(None, None), print)
    assert str(refused.value).isprintable()


@pytest.mark.parametrize("name", ["100%.toml", 'a"b.toml', "a\nb.toml"])
def test_a_configuration_that_it_cannot_name_is_refused_in_one_sentence(name: str, tmp_path: Path) -> None:
    config = tmp_path / name
    config.touch()
    with pytest.raises(DeployError, match="choose another directory or file"):
        supervisord.start("uv", StateDir(tmp_path), Launch.read(config, None), print)


@pytest.mark.parametrize(
    ("refused", "sentence"),
    [
        (
            "The minimum number of available processes required to run this program is 200 as per",
            "supervisord needs at least 200 processes: raise their limit (`ulimit -u`)",
        ),
        (
            "The minimum number of file descriptors required to run this process is 1024 as per",
            "supervisord needs at least 1024 file descriptors: raise their limit (`ulimit -n`)",
        ),
    ],
)
def test_a_limit_that_is_too_low_for_it_is_named_in_one_sentence(
    refused: str, sentence: str, tmp_path: Path
) -> None:
    uv = tmp_path / "uv"
    uv.write_text(
        f"#!/bin/sh\ncase $* in *--version) exit 0;; esac\necho 'Error: {refused} the argument' >&2\nexit 2\n"
    )
    uv.chmod(0o755)
    with pytest.raises(DeployError) as error:
        supervisord.start(str(uv), StateDir(tmp_path), Launch.read(None, None), print)
    assert str(error.value) == sentence


LOG = """\
2026-11-26 19:00:00,001 WARN exited: supervisor (terminated by SIGALRM; not expected)
2026-11-26 20:00:00,001 INFO supervisord started with pid 7
2026-11-26 20:00:01,002 WARN exited: sim (terminated by SIGKILL; not expected)
2026-11-26 20:00:02,003 WARN exited: supervisor (terminated by SIGALRM; not expected)
2026-11-26 20:00:02,103 INFO spawned: 'supervisor' with pid 9
2026-11-26 20:00:03,004 INFO stopped: sim (terminated by SIGTERM)
2026-11-26 20:00:04,005 WARN exited: sim (terminated by SIGALRM; not expected)
"""


def test_its_log_names_the_programs_that_hung_since_its_start(tmp_path: Path) -> None:
    state = StateDir(tmp_path)
    assert supervisord.hangs(state) == []
    state.log("supervisord").write_text(LOG)
    assert supervisord.hangs(state) == [("2026-11-26 20:00:02", "supervisor"), ("2026-11-26 20:00:04", "sim")]
