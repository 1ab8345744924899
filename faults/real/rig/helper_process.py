"""A helper process of the campaign; it takes orders on stdin, one per line, and answers each with a line."""

import json
import os
import selectors
import subprocess
import sys
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

    @property
    def pid(self) -> int:
        return self._process.pid

    def answer(self) -> str:
        """Return its next line.

        Raises:
            DeployError: there is none.
        """
        line = self._stdout.readline() if self._ready.select(ANSWER_LIMIT_S) else b""
        if not line:
            raise DeployError(f"the campaign's {self._name} (pid {self.pid}) does not answer")
        return line.decode().strip()

    def tell(self, order: dict[str, Any]) -> None:
        """Give an order without waiting for the answer.

        Raises:
            DeployError: it has ended.
        """
        try:
            self._stdin.write(json.dumps(order).encode() + b"\n")
            self._stdin.flush()
        except OSError as error:
            raise DeployError(f"the campaign's {self._name} has ended") from error

    def order(self, order: dict[str, Any]) -> str:
        """Give an order and return the answer."""
        self.tell(order)
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
