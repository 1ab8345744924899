"""The operator at the page of `lifeline station --drive`: the server of the page, and a page without a browser."""

import asyncio
import json
import os
import re
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

from deploy.stack.keyboard import TypedTeleop
from deploy.stack.launch import Launch, free_port

NAME = "phone"
ADDRESS = re.compile(r"http://\S+#\w+(?= within)")
"""The complete address of the page, as the server prints it."""
LOG = "page.log"
POLL_S = 0.02
NEW_CODE_KEY = "\r"


class StationOperator:
    """Drives by a page with teleop's keys; the source is the server.

    Args:
        launch: the robot.
        environment: the complete environment of both processes.
        directory: for the log of the page.
    """

    def __init__(self, launch: Launch, environment: dict[str, str], directory: Path) -> None:
        python, _, program, *options = Launch.command(launch, "lifeline.cli.app")
        more = ("station", "--name", NAME, "--port", str(free_port()), "--drive")
        self._environment, self._log = environment, directory / LOG
        self._server = TypedTeleop([python, "-m", program, *more, *options], environment)
        self._page: subprocess.Popen[bytes] | None = None
        self._opening = asyncio.ensure_future(self._open(""))

    async def _open(self, before: str) -> None:
        """Open a page when the server prints an address other than `before`."""
        while (address := self._address) in ("", before):  # noqa: ASYNC110 - no event announces it
            await asyncio.sleep(POLL_S)
        self._start_page(address)

    def _start_page(self, address: str) -> None:
        with self._log.open("ab") as log:
            self._page = subprocess.Popen(
                [sys.executable, "-m", "faults.real.rig.page", address],
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=log,
                env=self._environment,
                start_new_session=True,  # the campaign handles Ctrl-C
            )
        assert self._page.stdin is not None
        os.set_blocking(self._page.stdin.fileno(), False)

    @property
    def _address(self) -> str:
        found = ADDRESS.findall(self._server.last_lines)
        return found[-1] if found else ""

    @property
    def pid(self) -> int:
        """The process id of the server."""
        return self._server.pid

    @property
    def page_pid(self) -> int | None:
        """The process id of the page; None before it is opened, and after its end."""
        return self._page.pid if self._page is not None and self._page.poll() is None else None

    @property
    def running(self) -> bool:
        """Whether the server runs, and a page is open or about to be."""
        return self._server.running and (not self._opening.done() or self.page_pid is not None)

    @property
    def last_lines(self) -> str:
        return self._server.last_lines

    def press(self, keys: str) -> None:
        """Press keys at the page, if it is open."""
        self.order({"keys": keys})

    def order(self, order: dict[str, str | int | bool]) -> None:
        """Give the page an order, if it is open, without waiting for the page."""
        if self._page is not None and self._page.stdin is not None:
            with suppress(OSError):  # it has ended
                os.write(self._page.stdin.fileno(), json.dumps(order).encode() + b"\n")

    def open_again(self) -> bool:
        """Open a new page with a new code, if the server still runs; return whether it does."""
        if not self._server.running:
            return False
        self._end_page()
        self._opening.cancel()
        before = self._address
        self._server.press(NEW_CODE_KEY)
        self._opening = asyncio.ensure_future(self._open(before))
        return True

    async def close(self) -> None:
        """End the page and the server, even suspended ones."""
        self._opening.cancel()
        self._end_page()
        await self._server.close()

    def _end_page(self) -> None:
        if self._page is not None:
            self._page.kill()
            self._page.communicate()
            self._page = None
