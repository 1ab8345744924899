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
