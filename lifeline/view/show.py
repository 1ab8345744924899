"""`lifeline view`: show a robot, a recording or an incident in Rerun, or write it to a file. It publishes nothing."""

import asyncio
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

from deploy.stack.errors import DeployError
from deploy.stack.launch import Launch, free_port
from deploy.stack.reach import reach, run_command
from lifeline.view import window
from lifeline.view.rerun_log import RerunLog
from lifeline.view.scene import Scene, read_source, scene_of
from recordings.incidents.incident import damage_of
from recordings.recording import Recorded
from supervisor.config import SupervisorSection
from wire.bus import Bus, wait_until

DEPTH = 256
"""Samples of each topic that wait while others are drawn; beyond it, the oldest are dropped."""
LOOK_PERIOD_S = 0.05
LAST_LIMIT_S = 0.1
"""How long the end waits for the last messages to be drawn."""


@dataclass(frozen=True, slots=True)
class Wanted:
    """What to show, and where."""

    file: Path | None
    """A recording or an incident; None: the running robot."""
    out: Path | None
    """Write this file instead of opening a viewer."""
    web: bool
    """Serve the web viewer instead of opening a window."""
    port: int
    """Port of the web viewer; the data are on the next one."""


def view(wanted: Wanted, launch: Launch) -> NoReturn:
    """Show or write a robot or a file, until Ctrl-C, until the window closes, or until the file is written.

    Raises:
        DeployError: the configuration, the file or the port is refused, or there is no display.
    """
    config = launch.section("supervisor", SupervisorSection)
    if wanted.out is not None and wanted.out.exists():
        raise DeployError(f"{wanted.out} already exists: choose another file")
    if wanted.file is None:
        name, scene, recorded = launch.bus.namespace, scene_of(config, launch.bus.namespace), None
    else:
        name = wanted.file.name
        scene, recorded = read_source(wanted.file, config, launch.bus.namespace)
    if wanted.out is None and not wanted.web:
        window.check_display()
    if wanted.web:
        window.check_port(wanted.port)
        window.check_port(wanted.port + 1)

    async def main(stop: asyncio.Event) -> int:
        bus = await reach(launch.bus, stop) if recorded is None else None
        if stop.is_set():
            return 0
        with ExitStack() as at_end:
            if wanted.file is not None:
                at_end.enter_context(damage_of(wanted.file))
            return await Shown(stop, wanted, name, scene, at_end).run(bus, recorded)

    run_command(main)


class Shown:
    """A view in progress. Rerun is called on a thread of its own: if it blocks, Ctrl-C still ends the command."""

    def __init__(
        self, stop: asyncio.Event, wanted: Wanted, name: str, scene: Scene, at_end: ExitStack
    ) -> None:
        self._stop, self._wanted, self._name, self._scene, self._at_end = stop, wanted, name, scene, at_end
        self._viewer: window.Viewer | None = None
        self._drawn = 0
        self._thread = ThreadPoolExecutor(1)
        self._loop = asyncio.get_running_loop()

    async def run(self, bus: Bus | None, recorded: Iterator[Recorded] | None) -> int:
        """Show messages until the end, and return the exit code."""
        log = RerunLog(self._name, follows=recorded is None)
        opened = await self._on_thread(lambda: self._open(log))
        if opened is None:
            return 0
        print(f"lifeline: {opened}", flush=True)
        await self._on_thread(lambda: log.fixed(self._scene.fixed()))
        if bus is not None:
            await self._live(bus, log)
        elif recorded is not None:
            await self._on_thread(lambda: self._draw(log, recorded))
            while self._wanted.out is None and not self._is_closed:
                await wait_until(self._stop, self._loop.time() + LOOK_PERIOD_S)
        if self._wanted.out is not None:
            await asyncio.wrap_future(self._thread.submit(log.close))
            size = self._wanted.out.stat().st_size
            refused = f", {self._scene.undecodable:,} undecodable" if self._scene.undecodable else ""
            print(f"lifeline: {self._wanted.out}: {self._drawn:,} messages{refused}, {size / 1e6:.2f} MB")
        return 0

    async def _on_thread(self, work: Callable[[], Any]) -> Any:  # noqa: ANN401 - any result of the work
        """Run work on the thread; return None if Ctrl-C comes first and the work takes longer than `LAST_LIMIT_S`."""
        working = asyncio.wrap_future(self._thread.submit(work))
        stopping = asyncio.ensure_future(self._stop.wait())
        await asyncio.wait({working, stopping}, return_when=asyncio.FIRST_COMPLETED)
        stopping.cancel()
        if not working.done():
            await asyncio.wait({working}, timeout=LAST_LIMIT_S)
        return working.result() if working.done() else None

    def _open(self, log: RerunLog) -> str:
        """Open the file or the viewer, and return a sentence about it.

        Raises:
            DeployError: it cannot be opened.
        """
        out = self._wanted.out
        if out is not None:
            try:
                log.save(out)
            except (OSError, RuntimeError) as error:
                raise DeployError(f"cannot write {out} ({error}): choose another file") from error
            return f"writing {out}; press Ctrl-C to end"
        if self._wanted.web:
            address, own_port = log.serve(self._wanted.port + 1), free_port()
            server = window.Viewer("--serve-web", "--web-viewer-port", str(own_port), address)
            self._at_end.callback(server.close)
            files = window.files_of(server, own_port)
            server.close()
            shown = window.serve(files, self._wanted.port, address)
            return f"open {shown} in a browser on this machine; press Ctrl-C to end"
        address = log.serve(free_port())
        self._viewer = window.Viewer(address, "--port", "auto", "--hide-welcome-screen")
        self._at_end.callback(self._viewer.close)
        return "showing the view in Rerun; close its window or press Ctrl-C to end"

    @property
    def _is_closed(self) -> bool:
        return self._stop.is_set() or (self._viewer is not None and self._viewer.has_ended)

    async def _live(self, bus: Bus, log: RerunLog) -> None:
        # One offset for all messages: a step of the wall clock does not reorder them.
        wall_ns = time.time_ns() - round(self._loop.time() * 1e9)
        heard = {name: bus.subscribe(topic, depth=DEPTH) for name, topic in self._scene.topics.items()}
        while not self._is_closed:
            taken = [
                Recorded(name, "", wall_ns + round(arrival.arrival_s * 1e9), 0, arrival.payload)
                for name, subscription in heard.items()
                for arrival in subscription.take_raw()
            ]
            batch = sorted(taken, key=lambda one: one.log_time_ns)
            await self._on_thread(lambda batch=batch: self._draw(log, batch))
            await wait_until(self._stop, self._loop.time() + LOOK_PERIOD_S)

    def _draw(self, log: RerunLog, recorded: Iterable[Recorded]) -> None:
        for message in recorded:
            if self._stop.is_set():
                return
            primitives = self._scene.draw(message.topic, message.log_time_ns * 1e-9, message.payload)
            if primitives:
                log.log(message.log_time_ns, primitives)
                self._drawn += 1
