"""The commands that show and record a robot: status, watch, metrics, view, record, render, graph, topic, node, pid."""

from pathlib import Path
from typing import Annotated

import typer

from deploy.stack.console import answer, note
from lifeline.command import (
    ROBOT_PANEL,
    Json,
    KeysPath,
    ResultJson,
    Robot,
    StatePath,
    argument,
    command,
    option,
    robot_command,
)
from wire.host.installation import require

app = typer.Typer()
topic_app = typer.Typer(
    help="Inspect the topics of a running robot. cmd_vel, /robot/cmd_vel and robot/cmd_vel name the same topic.",
    no_args_is_help=True,
)
node_app = typer.Typer(help="Inspect the nodes of a running robot.", no_args_is_help=True)
app.add_typer(topic_app, name="topic")
app.add_typer(node_app, name="node")

HULLS = ("round", "rectangular")
CAMERAS = ("follow", "corner", "top")


# --- the words that the shells complete


def topic_names(incomplete: str) -> list[str]:
    """Return the topics of a robot with the default configuration, also as absolute names if a word has begun."""
    from lifeline.inspection.keys import by_full_key
    from supervisor.config import SupervisorSection

    keys = by_full_key("robot", SupervisorSection())
    absolute = ("/robot/", "robot/") if incomplete else ()
    return [key.replace("robot/", prefix, 1) for prefix in ("", *absolute) for key in keys]


def node_names() -> list[str]:
    from wire.topics import SIM, SUPERVISOR, TELEOP

    return [SUPERVISOR, SIM, TELEOP]


def layout_names() -> list[str]:
    from sim.layout import known

    return known()


# --- common options

Name = Annotated[str, argument("TOPIC", "Name of a topic, such as cmd_vel.", autocompletion=topic_names)]
Names = Annotated[
    list[str], argument("TOPIC…", "Names of topics, such as cmd_vel.", autocompletion=topic_names)
]
Listen = Annotated[float, option("--seconds", "S", "Listening time in s.", min=0.1, max=3600.0)]
FileOrId = Annotated[
    str | None,
    argument(
        "[FILE|ID]",
        "A recording (.mcap), a black box (.jsonl.gz) or an incident's ID. Default: the running robot.",
    ),
]
Also = Annotated[
    float | None,
    option("--seconds", "S", "Also listen, for the rate and undeclared writers.", min=0.1, max=3600.0),
]
Until = Annotated[
    float | None,
    option("--seconds", "S", "End after S seconds. Default: until Ctrl-C.", min=0.1, max=86400.0),
]


# --- the commands


def _file_of(robot: Robot, what: str | None) -> Path | None:
    """Return the recording or the black box that an argument names; None: the running robot."""
    from recordings.incidents.incident import directory_of, find

    if what is None or what.endswith(".mcap"):
        return None if what is None else Path(what)
    return find(directory_of(robot.launch, robot.state), what)


@robot_command(app)
def status(robot: Robot, *, as_json: Json = False) -> int:
    """Print the status once. Exit 0 if the stack runs, 1 if only a part of it runs, 3 if nothing runs."""
    from lifeline.status import show_status

    return show_status(robot.state, robot.launch, as_json=as_json)


@command(app)
def watch(
    *,
    as_json: Annotated[
        bool,
        typer.Option(
            "--json", help="Print JSON lines instead of a table; default on a pipe or a dumb terminal."
        ),
    ] = False,
    once: Annotated[
        bool,
        typer.Option(
            "--once", help="Print one row per robot. Exit 0 if all answer, 1 if some do, 3 if none does."
        ),
    ] = False,
    config: Annotated[
        list[Path] | None,
        option(
            "--config",
            "FILE",
            "Configuration file of a robot; repeat for several robots.",
            rich_help_panel=ROBOT_PANEL,
        ),
    ] = None,
    endpoint: Annotated[
        list[str] | None,
        option(
            "--endpoint",
            "tcp/HOST:PORT",
            "Address on which a supervisor listens; repeat for several robots.",
            rich_help_panel=ROBOT_PANEL,
        ),
    ] = None,
    keys_dir: KeysPath = None,
    state_dir: StatePath = None,
) -> None:
    """Show a live table of one or several robots until Ctrl-C."""
    from lifeline.watch.watch import launches, watch

    if config or endpoint:
        robots = launches(config or (), endpoint or (), keys_dir)
    else:
        robots = [Robot.find(keys_dir=keys_dir, state_dir=state_dir).launch]
    watch(robots, as_json=as_json, once=once)


@robot_command(app)
def metrics(
    robot: Robot,
    *,
    listen: Annotated[
        str, option("--listen", "HOST:PORT", "Address to serve HTTP on; port 0 chooses a free one.")
    ] = "127.0.0.1:9464",
) -> None:
    """Serve counters and timings of a robot to Prometheus, until Ctrl-C."""
    from lifeline.watch.metrics import metrics

    metrics(robot.launch, listen)


@robot_command(app)
def view(
    robot: Robot,
    *,
    what: FileOrId = None,
    out: Annotated[
        Path | None, option("--out", "FILE.rrd", "Write a file for Rerun instead of opening a window.")
    ] = None,
    web: Annotated[
        bool,
        typer.Option(
            "--web", help="Serve the viewer to a browser on this machine instead of opening a window."
        ),
    ] = False,
    port: Annotated[
        int, option("--port", "N", "With --web: port of the page; its data are on N+1.", min=1, max=65534)
    ] = 9090,
) -> None:
    """Show the robot in Rerun: hull, lidars, seen space, velocities, mode and reasons."""
    require("view")
    from lifeline.view.show import Wanted, view

    view(Wanted(_file_of(robot, what), out, web, port), robot.launch)


@robot_command(app)
def record(
    robot: Robot,
    *,
    file: Annotated[Path, argument("FILE", "The file to write: NAME.mcap.")],
    as_json: ResultJson = False,
) -> None:
    """Record all messages in an MCAP file, as rosbag2 does, until Ctrl-C."""
    from recordings.record import record

    record(file, robot.launch, as_json=as_json)


@robot_command(app)
def render(
    robot: Robot,
    *,
    what: FileOrId = None,
    out: Annotated[
        Path,
        option("--out", "FILE", "The file to write: a picture (.png) or an animation (.mp4, .webp, .gif)."),
    ],
    scene: Annotated[
        str | None,
        typer.Option(
            "--scene",
            "--layout",
            metavar="NAME|FILE",
            help="Name of a layout, or a layout or MJCF file. Default: as configured.",
            autocompletion=layout_names,
        ),
    ] = None,
    hull: Annotated[
        str | None,
        option(
            "--hull",
            "SHAPE",
            "Hull: round or rectangular. Default: as configured.",
            autocompletion=lambda: HULLS,
        ),
    ] = None,
    camera: Annotated[
        str,
        option(
            "--camera",
            "NAME",
            "View: follow, corner, top, or a camera of the scene.",
            autocompletion=lambda: CAMERAS,
        ),
    ] = "follow",
    size: Annotated[str, option("--size", "WxH", "Size in pixels.")] = "1280x720",
    seconds: Annotated[
        float | None,
        option(
            "--seconds", "S", "Duration; a picture shows the last moment. Default: 8 s, or the whole file."
        ),
    ] = None,
    fps: Annotated[float, option("--fps", "N", "Frames per second of an animation.")] = 15.0,
    fresh: Annotated[bool, typer.Option("--fresh", help="Render a new robot at its start.")] = False,
    drive: Annotated[
        bool,
        typer.Option(
            "--drive", help="Drive a new robot toward a pillar under the real safety law, and back out."
        ),
    ] = False,
    caption: Annotated[
        bool, typer.Option(help="Print the mode, speed and nearest distance on each frame.")
    ] = True,
    as_json: Json = False,
) -> None:
    """Render the running robot, a recording or an incident to an image or animation; no display is needed.

    `lifeline render --out now.png` draws the robot where it is now. `lifeline render drive.mcap --out drive.mp4` films what `lifeline record drive.mcap` recorded.

    The pose is the simulator's true one. A real robot and an incident are drawn by odometry, which drifts, on an open floor or from the start of `--scene`.
    """
    require("sim")
    from deploy.stack.errors import DeployError
    from deploy.stack.reach import NotRunningError
    from lifeline.render.footage import Footage, of_file, of_robot
    from lifeline.render.render import Wanted, render

    wanted = Wanted(out, scene, hull, camera, size, seconds, fps, drive, caption)
    file, is_new = _file_of(robot, what), fresh or drive
    if file is not None and is_new:
        raise DeployError(f"{file} does not show a new robot: leave out the file, or --fresh and --drive")

    def find() -> Footage | None:
        if file is not None:
            return of_file(robot.launch, file)
        try:
            return None if is_new else of_robot(robot.launch, wanted.listening_s)
        except NotRunningError as error:
            note(f"{error}; rendering a new robot at its start")
            return None

    rendered = render(wanted, find)
    answer(rendered._asdict(), rendered.sentence, as_json=as_json)


@robot_command(app)
def graph(
    robot: Robot,
    *,
    out: Annotated[
        Path | None, option("--out", "FILE", "Write a drawing (.svg, .png) or a Graphviz file (.dot).")
    ] = None,
    seconds: Listen = 2.0,
    as_json: Json = False,
) -> None:
    """Show which nodes communicate, from the hub's sessions and the received messages."""
    from lifeline.inspection.graph import show_graph

    show_graph(robot.launch, out, seconds, as_json=as_json)


@robot_command(topic_app, "list")
def topic_list(robot: Robot, *, seconds: Listen = 2.0, as_json: Json = False) -> None:
    """List all topics with their types, permitted writers, actual writers and rates, then all other keys."""
    from lifeline.inspection.listing import list_topics

    list_topics(robot.launch, seconds, as_json=as_json)


@robot_command(topic_app, "info")
def topic_info(robot: Robot, *, key: Name, seconds: Also = None, as_json: Json = False) -> None:
    """Print the writers and readers of a topic. Exit 1 if it has more writers than permitted."""
    from lifeline.inspection.listing import show_topic

    show_topic(robot.launch, key, seconds, as_json=as_json)


@robot_command(topic_app, "type")
def topic_type(
    robot: Robot,
    *,
    key: Name,
    full: Annotated[bool, typer.Option("--full", help="Also print the definition.")] = False,
    as_json: Json = False,
) -> None:
    """Print the ROS 2 type of a topic."""
    from lifeline.inspection.keys import show_type

    show_type(robot.launch, key, full=full, as_json=as_json)


@robot_command(topic_app, "echo")
def topic_echo(
    robot: Robot,
    *,
    keys: Names,
    once: Annotated[bool, typer.Option("--once", help="Print one message and exit.")] = False,
    field: Annotated[
        str, option("--field", "PATH", "Print only a field, such as linear.x or ranges.0.")
    ] = "",
    as_csv: Annotated[bool, typer.Option("--csv", help="Print CSV, with a header.")] = False,
    as_json: Json = False,
) -> None:
    """Print the messages of topics as YAML, until Ctrl-C."""
    from lifeline.inspection.topic import Echo, echo

    echo(robot.launch, keys, Echo(once, field, as_csv, as_json))


@robot_command(topic_app, "hz")
def topic_hz(robot: Robot, *, keys: Names, seconds: Until = None, as_json: Json = False) -> None:
    """Measure the rates of topics, and the gaps between messages. Exit 1 if nothing was heard."""
    from lifeline.inspection.topic import measure, rate_report

    measure(robot.launch, keys, rate_report, seconds, as_json=as_json)


@robot_command(topic_app, "bw")
def topic_bw(robot: Robot, *, keys: Names, seconds: Until = None, as_json: Json = False) -> None:
    """Measure the bandwidth of topics. Exit 1 if nothing was heard."""
    from lifeline.inspection.topic import measure, size_report

    measure(robot.launch, keys, size_report, seconds, as_json=as_json)


@robot_command(topic_app, "delay")
def topic_delay(robot: Robot, *, keys: Names, seconds: Until = None, as_json: Json = False) -> None:
    """Measure the ages of messages at arrival, from the senders' stamps. Exit 1 if nothing was heard."""
    from lifeline.inspection.topic import age_report, measure

    measure(robot.launch, keys, age_report, seconds, as_json=as_json)


@robot_command(topic_app, "pub")
def topic_pub(
    robot: Robot,
    *,
    key: Annotated[
        str, argument("KEY", "Name of a topic, such as estop or path/cmd_vel.", autocompletion=topic_names)
    ],
    message: Annotated[str, argument("YAML", "The message, such as '{linear: {x: 0.1}}'; the rest is zero.")],
    rate: Annotated[
        float | None, option("--rate", "HZ", "Publish at this rate until Ctrl-C.", min=0.01, max=500.0)
    ] = None,
    once: Annotated[bool, typer.Option("--once", help="Publish one message and exit.")] = False,
) -> None:
    """Publish an e-stop, an obstacle, or the commands of a command source that no other program holds.

    The commands of a source are sent until Ctrl-C, after 1 s of zero, which arms the source.
    """
    from lifeline.inspection.topic import publish

    publish(robot.launch, key, message, rate, once=once)


@robot_command(node_app, "list")
def node_list(robot: Robot, *, as_json: Json = False) -> None:
    """List all nodes with their processes. A program without a liveliness token is listed by its program name."""
    from lifeline.inspection.listing import list_nodes

    list_nodes(robot.launch, as_json=as_json)


@robot_command(node_app, "info")
def node_info(
    robot: Robot,
    *,
    node: Annotated[str, argument("NODE", "Name, pid or session id of a node.", autocompletion=node_names)],
    seconds: Listen = 2.0,
    as_json: Json = False,
) -> None:
    """Print a node's process, and the topics that it writes, reads and serves, with their rates."""
    from lifeline.inspection.listing import show_node

    show_node(robot.launch, node, seconds, as_json=as_json)


@robot_command(app)
def pid(
    robot: Robot,
    *,
    node: Annotated[str, argument("NODE", "Name of a node.", autocompletion=node_names)],
) -> None:
    """Print the process id of a node, for `kill -9 $(lifeline pid teleop)`. Exit 2 unless exactly one runs on this computer."""
    from lifeline.inspection.listing import print_pid

    print_pid(robot.launch, node)
