"""Operator and robot on two hosts: network namespaces that only a router in user space connects."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from bench.link.namespaces import inside, pair, why_not
from bench.rig.program import ROOT
from tests.system.two_hosts import OPERATORS, VIEWERS
from wire import topics
from wire.zenoh.session import DATAGRAM_BYTES

LIMIT_S = 110.0
LONGEST_GAP_S = 2.0

reason = why_not()
pytestmark = [
    pytest.mark.timeout(120),
    pytest.mark.skipif(reason is not None, reason=str(reason)),
]


def play(scenario: str, protocol: str, logs: Path) -> dict[str, Any]:
    """Play a scenario of two_hosts.py in the robot's namespace, and return what it has measured."""
    with pair([OPERATORS, VIEWERS]) as spaces:
        fds = (spaces.a_fd, spaces.b_fd)
        words = [scenario, spaces.a, *map(str, fds), "--protocol", protocol, "--logs", str(logs)]
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
    return measured


@pytest.mark.timed
@pytest.mark.parametrize("protocol", ["tcp", "quic"])
def test_a_cut_link_stops_the_robot_until_the_returned_operator_sends_neutral(
    tmp_path: Path, protocol: str
) -> None:
    measured = play("cut", protocol, tmp_path)
    assert measured["to_zero_s"] < measured["to_rest_s"]


@pytest.mark.timed
def test_the_operators_commands_arrive_when_the_links_of_viewers_die(tmp_path: Path) -> None:
    """Zenoh waits for a dead TCP link up to ten seconds, on a thread that also receives from the other links."""
    assert play("viewers", "tcp", tmp_path)["longest_gap_s"] < LONGEST_GAP_S


@pytest.mark.timed  # a sender without processor time drops samples of a stream that waits for a repetition
def test_over_quic_a_lost_packet_loses_only_its_own_sample(tmp_path: Path) -> None:
    """Missing sequence numbers prove that samples were datagrams: a QUIC stream delivers all of them, the later ones late."""
    measured = play("lossy", "quic", tmp_path)
    scan = measured.pop(topics.SCAN.key)
    for key, transit in measured.items():
        assert transit["lost"] > 0, key
    assert scan["bytes"] > DATAGRAM_BYTES
    assert scan["lost"] == 0, "a sample of several packets is a stream's"
