"""A supervisord that does not answer."""

import gc
import socket
from pathlib import Path

from deploy.stack import supervisord
from deploy.stack.statedir import StateDir


def test_one_that_does_not_answer_has_no_programs_and_leaves_no_socket_open(tmp_path: Path) -> None:
    state = StateDir(tmp_path)
    with socket.socket(socket.AF_UNIX) as dead:
        dead.bind(str(state.socket))
    assert supervisord.programs(state) is None
    gc.collect()  # collecting an open socket raises a warning, which fails the test
