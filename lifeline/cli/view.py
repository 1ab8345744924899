"""The definition of `lifeline view`."""

from pathlib import Path
from typing import Annotated

import typer

from lifeline.command import Config, Endpoint, KeysPath, StatePath, exit_with, running
from wire.host.extras import require


def view(
    *,
    what: Annotated[
        str | None,
        typer.Argument(
            metavar="[FILE|ID]",
            help="A recording (.mcap), a black box (.jsonl.gz) or an incident's ID. Default: the running robot.",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE.rrd", help="Write a file for Rerun instead of opening a window."),
    ] = None,
    web: Annotated[
        bool,
        typer.Option(
            "--web", help="Serve the viewer to a browser on this machine instead of opening a window."
        ),
    ] = False,
    port: Annotated[
        int,
        typer.Option(
            "--port", min=1, max=65534, metavar="N", help="With --web: port of the page; its data are on N+1."
        ),
    ] = 9090,
    config: Config = None,
    endpoint: Endpoint = None,
    keys_dir: KeysPath = None,
    state_dir: StatePath = None,
) -> None:
    """Show the robot in Rerun: hull, lidars, seen space, velocities, mode and reasons."""

    def run() -> int:
        require("view")
        from deploy.stack.statedir import StateDir  # noqa: PLC0415
        from lifeline.incidents.files import directory_of, find  # noqa: PLC0415
        from lifeline.view.show import Wanted  # noqa: PLC0415
        from lifeline.view.show import view as show  # noqa: PLC0415

        launch = running(config, endpoint, state_dir, keys_dir)
        if what is None or what.endswith(".mcap"):
            file = None if what is None else Path(what)
        else:
            file = find(directory_of(launch, StateDir.choose(state_dir)), what)
        show(Wanted(file, out, web, port), launch)

    exit_with(run)
