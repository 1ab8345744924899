"""`lifeline completion` in the real shells: a user types a word, presses Tab and sees it completed."""

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pexpect
import pyte
import pytest

from deploy.stack.errors import EXIT_REFUSED
from lifeline.cli.app import COMPLETED
from tests.system.harness import PATIENCE_S

COLUMNS = 120
BIN = Path(sys.executable).parent
SHELLS = {
    "bash": ["--norc", "--noprofile", "-i"],
    "zsh": ["-f", "-i"],
    "fish": ["--no-config", "-i"],
}
LOADED = {
    "bash": "source <(lifeline completion bash) && echo load''ed",
    "zsh": "source <(lifeline completion zsh) && echo load''ed",
    "fish": "lifeline completion fish | source; set -g fish_autosuggestion_enabled 0; echo load''ed",
}
CASES = [
    ("lifeline statu", "lifeline status"),
    ("lifeline topic echo supervisor/st", "lifeline topic echo supervisor/status"),
    ("lifeline topic echo --fi", "lifeline topic echo --field"),
    ("lifeline faults --classes teleop_gil,sim_scan_sil", "--classes teleop_gil,sim_scan_silent"),
    ("lifeline check my_ro", "lifeline check my_robot.toml"),
    (f"{BIN}/lifeline statu", "lifeline status"),
]
"""One word of each kind, in every shell."""
MORE_CASES = [
    ("lifeline topic ec", "lifeline topic echo"),
    ("lifeline topic hz /robot/te", "lifeline topic hz /robot/teleop/cmd_vel"),
    ("lifeline topic bw --endpoint tcp/127.0.0.1:7447 im", "7447 imu"),
    ("lifeline node info superv", "lifeline node info supervisor"),
    ("lifeline faults --classes teleop_sigs", "--classes teleop_sigstop"),
    ("lifeline render --scene war", "lifeline render --scene warehouse"),
    ("lifeline completion fi", "lifeline completion fish"),
]
"""What Lifeline itself completes does not depend on the shell."""


class Terminal:
    """A shell on a pseudo-terminal, whose screen can be read."""

    def __init__(self, shell: str, directory: Path) -> None:
        self.screen = pyte.Screen(COLUMNS, 50)
        self._stream = pyte.ByteStream(self.screen)
        environment = os.environ | {
            "HOME": str(directory),
            "XDG_CONFIG_HOME": str(directory / "config"),
            "PATH": f"{BIN}:{os.environ['PATH']}",
            "TERM": "xterm",
            "PS1": "$ ",
        }
        self._process = pexpect.spawn(
            shell,
            SHELLS[shell],
            cwd=str(directory),
            env=environment,
            dimensions=(50, COLUMNS),
        )
        self._process.delaybeforesend = None

    def type(self, keys: str) -> None:
        self._process.send(keys)

    def sees(self, text: str) -> bool:
        """Wait until the screen shows a text; return whether it does in time."""
        end_s = time.monotonic() + PATIENCE_S
        while time.monotonic() < end_s:
            # A long line wraps.
            if text in "".join(self.screen.display):
                return True
            try:
                data = bytes(self._process.read_nonblocking(65536, timeout=0.2))  # pyright: ignore[reportUnknownArgumentType]
            except pexpect.TIMEOUT:
                continue
            for query in (b"\x1b[c", b"\x1b[0c"):  # fish waits until the terminal names itself
                if query in data:
                    self._process.send("\x1b[?6c")
            self._stream.feed(data)
        return False

    def close(self) -> None:
        self._process.close(force=True)


def test_a_shell_that_is_not_known_is_refused_in_a_sentence() -> None:
    done = subprocess.run(
        [BIN / "lifeline", "completion", "tcsh"], capture_output=True, text=True, check=False
    )
    assert done.returncode == EXIT_REFUSED
    assert done.stderr == "lifeline: there is no completion for 'tcsh'; there is one for bash, zsh, fish\n"


@pytest.mark.timeout(240)
@pytest.mark.parametrize("shell", COMPLETED)
def test_tab_completes_commands_options_values_and_files(shell: str, tmp_path: Path) -> None:
    if shutil.which(shell) is None:
        pytest.skip(f"{shell} is not installed")
    (tmp_path / "my_robot.toml").touch()
    terminal = Terminal(shell, tmp_path)
    try:
        terminal.type(f"{LOADED[shell]}\n")
        assert terminal.sees("loaded"), terminal.screen.display
        for typed, expected in CASES + (MORE_CASES if shell == "bash" else []):
            terminal.type("\x0c")  # clear the screen
            terminal.type(f"{typed}\t")
            assert terminal.sees(expected), (typed, [row for row in terminal.screen.display if row.strip()])
            terminal.type("\x15")  # delete the line
    finally:
        terminal.close()
