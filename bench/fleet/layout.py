"""Robots behind one router, with certificates: the operators connect to the router, and the sensors to each hub."""

import re
import subprocess
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from bench.rig.program import program
from bench.robots.feeder import namespace_of
from bench.robots.load import usage
from bench.robots.run import Layout
from deploy.keys.commands import init, issue
from deploy.keys.register import Request
from deploy.stack.launch import free_loopback_endpoint
from wire.roles import ANY, Role

DAY_S = 86400.0
LIMIT_S, START_LIMIT_S = 10.0, 60.0
_BYTES = re.compile(r"bytes_(?:sent|received):(\d+)")


class Site(Layout):
    """A router, and robots that dial out to it."""

    def __init__(self, endpoint: str, pid: int, operator: Path, configs: Sequence[Path]) -> None:
        self._endpoint, self._pid, self._operator, self._configs = endpoint, pid, operator, configs

    def options(self, number: int) -> list[str]:
        return ["--config", str(self._configs[number])]

    def feeder(self, endpoints: Sequence[str]) -> list[str]:
        return [*endpoints, "--router", self._endpoint, "--keys", str(self._operator)]

    def operator(self, number: int, endpoint: str) -> str:  # noqa: ARG002 - that of the router is used
        return f"{self._endpoint} {namespace_of(number)} {self._operator}"

    def router_cpu_s(self) -> float:
        return usage(self._pid).cpu_s

    def crossed_bytes(self) -> int:
        port = self._endpoint.rpartition(":")[2]
        # Each link is counted at the router's side.
        command = ["ss", "-tinH", "state", "established", f"( sport = :{port} )"]
        done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=LIMIT_S)
        return sum(map(int, _BYTES.findall(done.stdout)))


@contextmanager
def site(robots: int) -> Generator[Site]:
    """Run a router for a number of robots, and write their configurations, while the context is open."""
    with TemporaryDirectory() as folder:
        keys, names = Path(folder) / "keys", [namespace_of(number) for number in range(robots)]
        init(keys, replace=False)

        def bundle(name: str, role: Role, robot: str) -> Path:
            return Path(issue(keys, Request(name, role, robot, None), DAY_S * 30)["bundle"])

        endpoint = free_loopback_endpoint().replace("tcp", "tls")
        configs = [Path(folder) / f"{name}.toml" for name in names]
        for name, config in zip(names, configs, strict=True):
            config.write_text(
                f'[bus]\nnamespace = "{name}"\nkeys = "{bundle(name, Role.SUPERVISOR, name)}"\nrouters = ["{endpoint}"]\n'
            )
        words = ["router", "--listen", endpoint, "--keys", str(bundle("site", Role.ROUTER, ANY))]
        words += [f"--robot={name}" for name in names]
        with program("lifeline.cli.app", arguments=words) as router:
            while "routing for" not in router.line(START_LIMIT_S):
                pass
            yield Site(endpoint, router.pid, bundle("operator", Role.OPERATOR, ANY), configs)
