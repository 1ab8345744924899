"""A helper process of the campaign that takes orders on its stdin, one a line, and answers each with a line."""

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
    """`python -m MODULE ARGUMENTS`, for as long as this process lives: at the end of its stdin it ends.

    Args:
        module: what it runs.
        arguments: for it.
        environment: what its environment has besides ours.
    """

    def __init__(self, module: str, *arguments: str, environment: dict[str, str]) -> None:
        self._name = module.rpartition(".")[2]
        self._process = subprocess.Popen(
            [sys.executable, "-m", module, *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=os.environ | environment,
            start_new_session=True,  # Ctrl-C is ours to handle
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
        """The next line that it says.

        Raises:
            DeployError: it says none.
        """
        line = self._stdout.readline() if self._ready.select(ANSWER_LIMIT_S) else b""
        if not line:
            raise DeployError(f"the campaign's {self._name} (pid {self.pid}) does not answer")
        return line.decode().strip()

    def tell(self, order: dict[str, Any]) -> None:
        """Give an order, and do not wait for its answer.

        Raises:
            DeployError: it has ended.
        """
        try:
            self._stdin.write(json.dumps(order).encode() + b"\n")
            self._stdin.flush()
        except OSError as error:
            raise DeployError(f"the campaign's {self._name} has ended") from error

    def order(self, order: dict[str, Any]) -> str:
        """Give an order, and return its answer."""
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
