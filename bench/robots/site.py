"""A router with certificates on every link: hubs dial out to it, and operators are behind it."""

import re
import subprocess
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from bench.rig.load import usage
from bench.rig.program import program
from deploy.keys.commands import init, issue
from deploy.keys.register import Request
from deploy.stack.launch import free_loopback_endpoint
from wire.roles import ANY, Role

DAY_S = 86400.0
START_LIMIT_S, SS_LIMIT_S = 60.0, 10.0
_BYTES = re.compile(r"bytes_(?:sent|received):(\d+)")


@dataclass(frozen=True)
class Site:
    """A router through which the operators reach their robots."""

    endpoint: str
    pid: int
    operator: Path
    """The bundle of the operators."""
    namespaces: Sequence[str]
    """Of each robot."""
    configs: Sequence[Path]
    """The configurations of the supervisors, which dial out to the router."""

    def use(self) -> tuple[float, int]:
        """Return the processor time of the router until now [s], and the bytes that it has sent and received on the open links."""
        port = self.endpoint.rpartition(":")[2]
        # Each link is counted at the router's side.
        command = ["ss", "-tinH", "state", "established", f"( sport = :{port} )"]
        done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=SS_LIMIT_S)
        return usage(self.pid).cpu_s, sum(map(int, _BYTES.findall(done.stdout)))


@contextmanager
def site(robots: int) -> Generator[Site]:
    """Run a router for a number of robots, and write their configurations, while the context is open."""
    with TemporaryDirectory() as folder:
        keys, names = Path(folder) / "keys", [f"robot{number}" for number in range(robots)]
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
            yield Site(endpoint, router.pid, bundle("operator", Role.OPERATOR, ANY), names, configs)
