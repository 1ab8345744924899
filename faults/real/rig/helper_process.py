"""Helper processes of the campaign; they take orders on stdin, one JSON object per line, and answer each with a line."""

import asyncio
import json
import os
import selectors
import subprocess
import sys
from collections.abc import Awaitable, Callable
from typing import Any

from deploy.stack.errors import DeployError

ANSWER_LIMIT_S = 20.0
END_LIMIT_S = 3.0


class HelperProcess:
    """Run `python -m MODULE ARGUMENTS`; the helper ends with this process, at the end of its stdin.

    Args:
        module: the module to run.
        arguments: its arguments.
        environment: environment variables in addition to ours.
    """

    def __init__(self, module: str, *arguments: str, environment: dict[str, str]) -> None:
        self._name = module.rpartition(".")[2]
        self._process = subprocess.Popen(
            [sys.executable, "-m", module, *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=os.environ | environment,
            start_new_session=True,  # the campaign handles Ctrl-C
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._stdin, self._stdout = self._process.stdin, self._process.stdout
        self._ready = selectors.DefaultSelector()
        self._ready.register(self._stdout, selectors.EVENT_READ)

    def answer(self) -> str:
        """Return its next line.

        Raises:
            DeployError: there is none.
        """
        line = self._stdout.readline() if self._ready.select(ANSWER_LIMIT_S) else b""
        if not line:
            raise DeployError(f"the campaign's {self._name} (pid {self._process.pid}) does not answer")
        return line.decode().strip()

    def order(self, order: dict[str, Any]) -> str:
        """Give an order and return the answer.

        Raises:
            DeployError: it has ended, or does not answer.
        """
        try:
            self._stdin.write(json.dumps(order).encode() + b"\n")
            self._stdin.flush()
        except OSError as error:
            raise DeployError(f"the campaign's {self._name} has ended") from error
        return self.answer()

    def close(self) -> None:
        self._ready.close()
        try:
            self._stdin.close()
            self._process.wait(END_LIMIT_S)
        except (OSError, subprocess.TimeoutExpired):
            self._process.kill()
            self._process.wait()
        finally:
            self._stdout.close()


async def serve(obey: Callable[[dict[str, Any]], Awaitable[object]]) -> None:
    """In a helper: obey each order and print the answer, until the end of stdin."""
    orders = asyncio.StreamReader()
    loop = asyncio.get_running_loop()
    await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(orders), sys.stdin)
    while line := await orders.readline():
        print(await obey(json.loads(line)), flush=True)


class Links(HelperProcess):
    """A running proxy.

    Args:
        hub: the endpoint of the supervisor, `tcp/HOST:PORT`.
        host: the address on which it listens.
        names: the names of its links.
        environment: additional environment of its process.
    """

    def __init__(
        self, hub: str, names: tuple[str, ...], *, environment: dict[str, str], host: str = "127.0.0.1"
    ) -> None:
        hub_host, hub_port = hub.partition("/")[2].rsplit(":", 1)
        super().__init__("faults.real.rig.proxy", hub_host, hub_port, host, *names, environment=environment)
        ports: dict[str, int] = json.loads(self.answer())
        self.endpoints = {name: f"tcp/{host}:{port}" for name, port in ports.items()}

    def open(self, link: str, *, up: bool = True, down: bool = True) -> None:
        """Open or close each direction; `up` leads to the hub."""
        self.order({"link": link, "up": up, "down": down})

    def delay(self, link: str, low_s: float, high_s: float) -> None:
        """Delay all data on this link, in both directions."""
        self.order({"link": link, "delay_s": [low_s, high_s]})

    def heal(self, link: str) -> None:
        self.order({"link": link, "up": True, "down": True, "delay_s": [0.0, 0.0]})
