"""The commands that explain a stop: doctor, incidents, replay-decision."""

from pathlib import Path
from typing import Annotated

import typer

from lifeline.command import Config, Json, Robot, StatePath, argument, command, option, robot_command

app = typer.Typer()
incidents_app = typer.Typer(
    help="List, show and export black boxes: the recordings of the time around each stop of a moving robot.",
    no_args_is_help=True,
)
app.add_typer(incidents_app, name="incidents")

Id = Annotated[
    str, argument("ID", "ID of an incident or its first characters, `last`, or the path of a black box file.")
]


@robot_command(app)
def doctor(
    robot: Robot,
    *,
    seconds: Annotated[float, option("--seconds", "S", "Listening time in s.", min=0.1, max=3600.0)] = 3.0,
    as_json: Json = False,
) -> None:
    """Explain why the robot does not move, or why the system cannot start. Exit 1 if there is a problem."""
    from lifeline.inspection.doctor import doctor as examine

    examine(robot.launch, robot.state, seconds, as_json=as_json)


def _on_this_computer(*, config: Config = None, state_dir: StatePath = None) -> Robot:
    """Return the robot whose files a command reads, without a connection."""
    return Robot.find(config=config, state_dir=state_dir)


@robot_command(incidents_app, "list", find=_on_this_computer)
def incidents_list(robot: Robot, *, as_json: Json = False) -> int:
    """List all incidents: time, reasons, owner, speed at the stop, stopping distance, and nearest distance."""
    from recordings.incidents.commands import show_list
    from recordings.incidents.incident import directory_of

    return show_list(directory_of(robot.launch, robot.state), as_json=as_json)


@robot_command(incidents_app, "show", find=_on_this_computer)
def incidents_show(
    robot: Robot,
    *,
    incident: Id,
    seconds: Annotated[
        float, option("--seconds", "S", "Time before the stop to show, in s.", min=0.1, max=3600.0)
    ] = 2.0,
    as_json: Json = False,
) -> int:
    """Show the seconds around a stop as a table and as plots. Exit 1 if a part of the file cannot be read."""
    from recordings.incidents.commands import show
    from recordings.incidents.incident import directory_of, find

    return show(find(directory_of(robot.launch, robot.state), incident), seconds, as_json=as_json)


@robot_command(incidents_app, "export", find=_on_this_computer)
def incidents_export(
    robot: Robot,
    *,
    incident: Id,
    file: Annotated[Path, argument("FILE", "The file to write: NAME.mcap.")],
    as_json: Json = False,
) -> int:
    """Write an incident as an MCAP file for Foxglove, PlotJuggler and ros2 bag.

    Exit 1 if a part of the black box cannot be read.
    """
    from recordings.incidents.commands import export
    from recordings.incidents.incident import directory_of, find

    black_box = find(directory_of(robot.launch, robot.state), incident)
    return export(black_box, file, robot.launch.bus.namespace, as_json=as_json)


@command(app)
def replay_decision(
    *,
    file: Annotated[Path, argument("FILE", "A black box file: blackbox/*.jsonl.gz.")],
    as_json: Json = False,
) -> int:
    """Run the law again over the recording of a stop. Exit 1 if any decision differs from the recording."""
    from recordings.incidents.replay import replay_decision

    return replay_decision(file, as_json=as_json)
