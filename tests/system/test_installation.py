"""Lifeline installed from its wheel, outside of the checkout: with the extra `sim`, and without any extra."""

import os
import subprocess
import sys
import threading
import time
import zipfile
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import pytest

from deploy.stack.errors import EXIT_REFUSED
from deploy.stack.supervisord import find_uv
from supervisor.estop_record import record_path
from tests.packages import PACKAGES
from tests.system import fake_ros2
from tests.system.operators import ROOT, Operator, until
from tests.system.ports import free_endpoint
from wire.host.installation import ENVIRONMENT

BUILD_LIMIT_S = 60.0
COMMAND_LIMIT_S = 30.0
DEMO_LIMIT_S = 100.0
START_LIMIT_S = 20.0
STATUS_PARTLY = 1
"""Exit code of `lifeline status` where only a part of the stack runs."""

OF_THE_CHECKOUT = ("PYTHONPATH", "VIRTUAL_ENV", ENVIRONMENT)
"""Variables that would lead an installed Lifeline back to the checkout or its environment."""

pytestmark = [pytest.mark.timeout(180), pytest.mark.demo]


@dataclass(frozen=True, slots=True)
class Installed:
    """A separate environment with Lifeline installed."""

    python: Path
    directory: Path
    """Empty; the working directory of every command."""

    @property
    def environment(self) -> dict[str, str]:
        kept = {key: value for key, value in os.environ.items() if key not in OF_THE_CHECKOUT}
        return kept | {"UV": find_uv(), "XDG_STATE_HOME": str(self.directory / "state")}

    def lifeline(self, *arguments: str, limit_s: float = COMMAND_LIMIT_S) -> subprocess.CompletedProcess[str]:
        return self.run(str(self.python.with_name("lifeline")), *arguments, limit_s=limit_s)

    def run(self, *command: str, limit_s: float = COMMAND_LIMIT_S) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            command,
            cwd=self.directory,
            env=self.environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            check=False,
            timeout=limit_s,
        )

    def status(
        self, condition: Callable[[subprocess.CompletedProcess[str]], bool], *options: str
    ) -> subprocess.CompletedProcess[str]:
        """Repeat `lifeline status` until a call meets the condition; on a busy machine, one call may show nothing."""
        deadline_s = time.monotonic() + COMMAND_LIMIT_S
        while not condition(done := self.lifeline("status", *options)):
            assert time.monotonic() < deadline_s, done.stdout + done.stderr
        return done

    @property
    def packages(self) -> Path:
        """Where the packages were installed."""
        found = self.run(str(self.python), "-c", "import deploy; print(deploy.__path__[0])")
        return Path(found.stdout.strip()).parent

    @contextmanager
    def supervisor(self, endpoint: str) -> Generator[list[str]]:
        """A supervisor that listens; yields the lines of its log so far."""
        command = [str(self.python), "-m", "supervisor", "--endpoint", endpoint]
        listens, lines = threading.Event(), list[str]()

        def read() -> None:
            assert process.stderr is not None
            for line in process.stderr:
                lines.append(line)
                if "listening on" in line:
                    listens.set()

        with subprocess.Popen(
            command, cwd=self.directory, env=self.environment, stderr=subprocess.PIPE, text=True
        ) as process:
            reader = threading.Thread(target=read)
            reader.start()
            try:
                assert listens.wait(START_LIMIT_S), lines
                yield lines
            finally:
                process.terminate()
                try:
                    process.wait(START_LIMIT_S)
                finally:
                    process.kill()
                    reader.join()


def uv(*arguments: str, **variables: str) -> str:
    """Return uv's output; skip the test if uv cannot reach its package index."""
    done = subprocess.run(
        [find_uv(), *arguments],
        cwd=ROOT,
        env={key: value for key, value in os.environ.items() if key not in OF_THE_CHECKOUT} | variables,
        capture_output=True,
        text=True,
        check=False,
        timeout=BUILD_LIMIT_S,
    )
    if done.returncode != 0 and "Failed to fetch" in done.stderr:
        pytest.skip(f"no package index: {done.stderr}")
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("wheel")
    uv("build", "--wheel", "--quiet", "--out-dir", str(directory))
    (built,) = directory.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def constraints(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The versions of uv.lock: `make setup` has put them into uv's cache."""
    file = tmp_path_factory.mktemp("constraints") / "constraints.txt"
    file.write_text(
        uv("export", "--frozen", "--no-dev", "--all-extras", "--no-emit-project", "--no-hashes", "--quiet")
    )
    return file


@pytest.fixture(scope="module")
def plain(wheel: Path, constraints: Path, tmp_path_factory: pytest.TempPathFactory) -> Installed:
    """Without extras, as on a robot's computer."""
    directory = tmp_path_factory.mktemp("plain")
    python = directory / "lifeline/bin/python"
    uv("venv", "--quiet", "--python", sys.executable, str(python.parents[1]))
    install = ("pip", "install", "--quiet", "--compile-bytecode", "--constraints", str(constraints))
    uv(*install, "--python", str(python), str(wheel))
    (directory / "work").mkdir()
    return Installed(python, directory / "work")


def test_the_wheel_holds_every_file_of_the_packages_and_nothing_else(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        held = {name for name in archive.namelist() if ".dist-info/" not in name}
    files = (path for package in PACKAGES for path in (ROOT / package).rglob("*") if path.is_file())
    assert held == {str(path.relative_to(ROOT)) for path in files if "__pycache__" not in path.parts}


def test_installed_as_a_tool_with_the_simulation_it_plays_the_demo(
    wheel: Path, constraints: Path, tmp_path: Path
) -> None:
    tools = {"UV_TOOL_DIR": str(tmp_path / "tools"), "UV_TOOL_BIN_DIR": str(tmp_path / "bin")}
    install = ("tool", "install", "--quiet", "--compile-bytecode", "--python", sys.executable)
    uv(*install, "--constraints", str(constraints), f"lifeline[sim] @ {wheel.as_uri()}", **tools)
    (tmp_path / "work").mkdir()
    tool = Installed(tmp_path / "tools/lifeline/bin/python", tmp_path / "work")
    command = str(tmp_path / "bin/lifeline")

    assert tool.packages.is_relative_to(tmp_path)
    assert tool.run(command, "--version").stdout == f"lifeline {version('lifeline')}\n"
    checked = tool.run(command, "check", str(tool.packages / "deploy/robot.toml"))
    assert checked.returncode == 0, checked.stdout + checked.stderr

    played = tool.run(command, "demo", "--quick", limit_s=DEMO_LIMIT_S)
    print(played.stdout)
    assert played.returncode == 0, played.stdout + played.stderr
    assert "killing teleop" in played.stdout
    assert "BROKEN" not in played.stdout


async def test_installed_without_extras_the_supervisor_serves_and_teleop_reaches_it(plain: Installed) -> None:
    endpoint = free_endpoint()
    with plain.supervisor(endpoint):
        status = plain.status(lambda done: "SCAN_STALE" in done.stdout, "--endpoint", endpoint)
        assert status.returncode == STATUS_PARTLY, status.stdout + status.stderr

        unset = [word for name in OF_THE_CHECKOUT for word in ("-u", name)]
        teleop = (str(plain.python), "-m", "teleop", "--endpoint", endpoint)
        operator = Operator("env", *unset, "-C", str(plain.directory), *teleop)
        try:
            await until(lambda: "SCAN_STALE" in operator.picture)
        finally:
            operator.close()


def test_an_installed_supervisor_finds_the_record_of_an_estop_from_any_working_directory(
    plain: Installed,
) -> None:
    record = record_path(plain.directory / "state" / "lifeline", "robot")
    record.parent.mkdir(parents=True, exist_ok=True)
    record.touch()
    endpoint = free_endpoint()
    try:
        with plain.supervisor(endpoint):
            plain.status(lambda done: "ESTOP" in done.stdout, "--endpoint", endpoint)
    finally:
        record.unlink()


def test_installed_without_extras_a_robot_that_is_not_simulated_comes_up(
    plain: Installed, tmp_path: Path
) -> None:
    config = tmp_path / "robot.toml"
    config.write_text(f'[ros2]\npython = "{fake_ros2.interpreter(tmp_path)}"\n')
    for options in (["--no-sim"], ["--config", str(config)]):
        endpoint = free_endpoint()
        try:
            up = plain.lifeline("up", "--detach", "--endpoint", endpoint, *options)
            assert up.returncode == 0, up.stderr
            plain.status(lambda done: done.returncode == 0)
        finally:
            assert plain.lifeline("down").returncode == 0


def test_installed_without_extras_the_profile_of_fast_dds_is_printed(plain: Installed) -> None:
    assert "leaseDuration" in plain.lifeline("ros2", "profile").stdout


@pytest.mark.parametrize("example", ["robot.toml", "examples/turtlebot4.toml"])
def test_installed_without_extras_check_accepts_a_configuration(plain: Installed, example: str) -> None:
    done = plain.lifeline("check", str(plain.packages / "deploy" / example))
    assert "the configuration is valid" in done.stdout, done.stderr


def test_installed_without_extras_down_finds_nothing_to_stop(plain: Installed) -> None:
    done = plain.lifeline("down")
    assert (done.returncode, done.stdout) == (0, "lifeline: nothing is running\n")


@pytest.mark.parametrize(
    "command",
    ["up --detach", "demo", "faults", "faults --virtual", "render --out picture.png", "-m sim"],
)
def test_installed_without_extras_a_command_that_simulates_names_the_extra_in_one_sentence(
    plain: Installed, command: str
) -> None:
    module = command.startswith("-m")
    done = plain.run(str(plain.python), *command.split()) if module else plain.lifeline(*command.split())
    assert done.returncode == EXIT_REFUSED
    assert done.stdout == ""
    assert done.stderr.startswith(
        f"{'sim' if module else 'lifeline'}: this needs an extra: install lifeline[sim], "
        "with `uv tool install '.[sim]'`"
    )
    assert done.stderr.count("\n") == 1
    assert list(plain.directory.iterdir()) in ([], [plain.directory / "state"])
