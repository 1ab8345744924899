"""Operator and robot on two hosts: network namespaces that only a router in user space connects."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from bench.link.namespaces import inside, pair, why_not
from bench.link.program import ROOT
from tests.system.two_hosts import NUMBER

LIMIT_S = 110.0

pytestmark = pytest.mark.timeout(120)
reason = why_not()


@pytest.mark.skipif(reason is not None, reason=str(reason))
@pytest.mark.parametrize("protocol", ["tcp"])
def test_a_cut_link_stops_the_robot_until_the_returned_operator_sends_neutral(
    tmp_path: Path, protocol: str
) -> None:
    with pair([NUMBER]) as spaces:
        fds = (spaces.a_fd, spaces.b_fd)
        words = [spaces.a, *map(str, fds), "--protocol", protocol, "--logs", str(tmp_path)]
        done = subprocess.run(
            [*inside(spaces.b), sys.executable, "-m", "tests.system.two_hosts", *words],
            cwd=ROOT,
            capture_output=True,
            text=True,
            timeout=LIMIT_S,
            check=False,
            pass_fds=fds,
        )
    assert done.returncode == 0, done.stdout + done.stderr
    measured = json.loads(done.stdout.splitlines()[-1])
    print(f"\n    measured: {measured}")
    assert measured["to_zero_s"] < measured["to_rest_s"]
