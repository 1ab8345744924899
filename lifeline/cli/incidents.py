"""The definitions of `lifeline incidents`. Each command imports its modules only when it runs."""

from pathlib import Path
from typing import Annotated

import typer

from lifeline.command import Config, Json, StatePath, exit_with, running

incidents_app = typer.Typer(
    help="List, show and export black boxes: the recordings of the time around each stop of a moving robot.",
    no_args_is_help=True,
)

Id = Annotated[
    str,
    typer.Argument(
        metavar="ID", help="Name of an incident or its beginning, `last`, or the path of a black box."
    ),
]


def _directory(config: Path | None, state_dir: Path | None) -> Path:
    from deploy.stack.statedir import StateDir  # noqa: PLC0415
    from lifeline.incidents.files import directory_of  # noqa: PLC0415

    return directory_of(running(config, None, state_dir), StateDir.choose(state_dir))


@incidents_app.command("list")
def incidents_list(*, as_json: Json = False, config: Config = None, state_dir: StatePath = None) -> None:
    """List all incidents: time, reasons, owner, speed at the stop, stopping distance, and nearest distance."""

    def run() -> int:
        from lifeline.incidents.commands import show_list  # noqa: PLC0415

        return show_list(_directory(config, state_dir), as_json=as_json)

    exit_with(run)


@incidents_app.command("show")
def incidents_show(
    *,
    incident: Id,
    seconds: Annotated[
        float,
        typer.Option(
            "--seconds", min=0.1, max=3600.0, metavar="S", help="Time before the stop to show, in s."
        ),
    ] = 2.0,
    as_json: Json = False,
    config: Config = None,
    state_dir: StatePath = None,
) -> None:
    """Show the seconds around a stop as a table and as plots. Exit 1 if a part of the file cannot be read."""

    def run() -> int:
        from lifeline.incidents.commands import show  # noqa: PLC0415
        from lifeline.incidents.files import find  # noqa: PLC0415

        return show(find(_directory(config, state_dir), incident), seconds, as_json=as_json)

    exit_with(run)


@incidents_app.command("export")
def incidents_export(
    *,
    incident: Id,
    file: Annotated[Path, typer.Argument(metavar="FILE", help="The file to write: NAME.mcap.")],
    as_json: Json = False,
    config: Config = None,
    state_dir: StatePath = None,
) -> None:
    """Write an incident as an MCAP file for Foxglove, PlotJuggler and ros2 bag.

    Exit 1 if a part of the black box cannot be read.
    """

    def run() -> int:
        from lifeline.incidents.commands import export  # noqa: PLC0415
        from lifeline.incidents.files import find  # noqa: PLC0415

        launch = running(config, None, state_dir)
        return export(
            find(_directory(config, state_dir), incident), file, launch.bus.namespace, as_json=as_json
        )

    exit_with(run)
