"""The operator's presence: keys on demand, terminals that answer no status requests, and tmux, which answers for a person."""

import asyncio
import os
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import AsyncGenerator, Callable
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from teleop.pilots.vigilance import DEAD_LINK_M, unanswered_limit_m_s
from tests.system.operators import (
    LIMIT_S,
    PATIENT,
    ZERO,
    Hub,
    Operator,
    free_endpoint,
    hub,
    operator,
    ready,
    until,
)
from wire.messages import SafetyStatus

pytestmark = pytest.mark.long
VIGILANCE_S = 2.0
LIMIT_M_S = unanswered_limit_m_s(VIGILANCE_S, 0.5)


@pytest.fixture
def config(tmp_path: Path) -> str:
    path = tmp_path / "robot.toml"
    path.write_text(f"[teleop]\nvigilance_s = {VIGILANCE_S}\n")
    return str(path)


async def test_without_a_key_the_robot_stops_after_a_demand_with_the_bell_and_enter_lets_it_drive_on(
    config: str,
) -> None:
    endpoint = free_endpoint()
    async with hub(endpoint) as h, operator(endpoint, "--config", config) as op:
        await ready(h, op)
        op.type(b"w")
        await until(lambda: h.asks(0.1, 0.0))
        seen = len(h.velocities)
        for _ in range(3):
            await until(lambda: h.tell(SafetyStatus.DRIVING, owner="teleop") or "PRESS ENTER" in op.picture)
            op.type(b"\r")
            await until(
                lambda: h.tell(SafetyStatus.DRIVING, owner="teleop") or "PRESS ENTER" not in op.picture
            )
        assert set(h.velocities[seen:]) == {(0.1, 0.0)}
        assert op.bells == 3
        await until(lambda: h.asks(*ZERO))
        await until(lambda: "no key was pressed on demand" in op.picture)
        op.type(b"w")
        await until(lambda: h.asks(0.1, 0.0))


@pytest.mark.parametrize(
    ("term", "options"), [("xterm-256color", ()), ("xterm-256color", ("--plain",)), ("dumb", ())]
)
async def test_behind_a_dead_link_to_a_terminal_that_answers_nothing_the_robot_drives_at_most_a_metre(
    config: str, term: str, options: tuple[str, ...]
) -> None:
    endpoint = free_endpoint()
    async with (
        hub(endpoint) as h,
        operator(endpoint, "--config", config, *options, term=term, answers=False) as op,
    ):
        await ready(h, op)
        op.type(b"wwww")
        await until(lambda: h.asks(LIMIT_M_S, 0.0))
        await until(lambda: f"at most {LIMIT_M_S} m/s" in op.output or str(LIMIT_M_S) in op.picture)
        driven_s = await until(lambda: h.asks(*ZERO))
        assert LIMIT_M_S * driven_s <= DEAD_LINK_M
        assert "no key was pressed on demand" in op.output or "no key was pressed on demand" in op.picture


async def test_the_display_of_one_line_asks_the_terminal_too_and_drives_at_full_speed_if_it_answers() -> None:
    endpoint = free_endpoint()
    async with hub(endpoint) as h, operator(endpoint, "--plain") as op:
        await ready(h, op)
        await until(lambda: op.answered > 0)
        op.type(b"wwww")
        await until(lambda: h.asks(0.4, 0.0))


async def test_key_releases_of_a_terminal_that_answers_no_status_requests_do_not_hold_a_motion() -> None:
    """The release that a dead link keeps back would never end it."""
    endpoint = free_endpoint()
    async with (
        hub(endpoint) as h,
        operator(endpoint, "--mode", "hold", kitty=31, answers=False) as op,
    ):
        await ready(h, op)
        await until(lambda: op.kitty_flags == [15])
        await until(lambda: "by key repeat" in op.picture)
        seen = len(h.velocities)
        op.key("i", 1)
        await asyncio.sleep(1.0)
        assert set(h.velocities[seen:]) == {ZERO}


# --- tmux


class Tmux:
    """A teleop in a tmux with a server of its own; the client is in a terminal."""

    def __init__(self, directory: str, *command: str) -> None:
        self._command = ["tmux", "-S", f"{directory}/socket", "-f", "/dev/null"]
        environment = {name: value for name, value in os.environ.items() if not name.startswith("TMUX")}
        words = [*self._command, "new-session", "-x", "100", "-y", "30", shlex.join(command)]
        self.client = Operator(*words, environment=environment)

    def run(self, *words: str) -> str:
        done = subprocess.run(
            [*self._command, *words], capture_output=True, text=True, check=False, timeout=LIMIT_S
        )
        return done.stdout

    @property
    def pane(self) -> str:
        """What teleop shows, whether or not a client shows it."""
        return self.run("capture-pane", "-p", "-t", ":0.0")

    def close(self) -> None:
        self.run("kill-server")
        self.client.close()


@asynccontextmanager
async def in_tmux(config: str) -> AsyncGenerator[tuple[Hub, Tmux]]:
    """A teleop in tmux that requests 0.1 m/s."""
    endpoint = free_endpoint()
    with tempfile.TemporaryDirectory(prefix="lifeline-tmux-") as directory:
        async with hub(endpoint) as h:
            tmux = Tmux(directory, sys.executable, *PATIENT, "--endpoint", endpoint, "--config", config)
            try:
                await until(
                    lambda: (
                        h.is_neutral() and (h.tell(SafetyStatus.READY) or "next command moves" in tmux.pane)
                    ),
                    2 * LIMIT_S,
                )
                tmux.client.type(b"w")
                await until(lambda: h.asks(0.1, 0.0))
                yield h, tmux
            finally:
                tmux.close()


PREFIX = b"\x02"
DISTRACTIONS: dict[str, Callable[[Operator], object]] = {
    "client killed": lambda client: client.send(signal.SIGKILL),
    "client stopped": lambda client: client.send(signal.SIGSTOP),
    "client not read": lambda client: client.look(at=False),
    "copy mode": lambda client: client.type(PREFIX + b"["),
    "choose-tree": lambda client: client.type(PREFIX + b"w"),
    "command prompt": lambda client: client.type(PREFIX + b":"),
    "another window": lambda client: client.type(PREFIX + b"c"),
}


@pytest.mark.skipif(shutil.which("tmux") is None, reason="needs tmux")
@pytest.mark.parametrize("distraction", DISTRACTIONS)
async def test_behind_a_tmux_that_no_person_sees_the_robot_stops_when_vigilance_ends(
    config: str, distraction: str
) -> None:
    async with in_tmux(config) as (h, tmux):
        DISTRACTIONS[distraction](tmux.client)
        driven_s = await until(lambda: h.asks(*ZERO))
        assert driven_s > VIGILANCE_S, "until then, tmux answers for the person"
        await until(lambda: "no key was pressed on demand" in tmux.pane)
