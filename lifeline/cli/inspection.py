"""The definitions of `lifeline topic`, `node`, `graph` and `doctor`. Each command imports its modules only when it runs."""

from pathlib import Path
from typing import Annotated

import typer

from lifeline.cli.completion import node_names, topic_names
from lifeline.command import Config, Endpoint, Json, KeysPath, StatePath, exit_with, running

topic_app = typer.Typer(
    help="Inspect the topics of a running robot. cmd_vel, /robot/cmd_vel and robot/cmd_vel name the same topic.",
    no_args_is_help=True,
)
node_app = typer.Typer(help="Inspect the nodes of a running robot.", no_args_is_help=True)

Name = Annotated[
    str,
    typer.Argument(metavar="TOPIC", help="Name of a topic, such as cmd_vel.", autocompletion=topic_names),
]
Names = Annotated[
    list[str],
    typer.Argument(metavar="TOPIC…", help="Names of topics, such as cmd_vel.", autocompletion=topic_names),
]
Listen = Annotated[
    float, typer.Option("--seconds", min=0.1, max=3600.0, metavar="S", help="Listening time in s.")
]
Until = Annotated[
    float | None,
    typer.Option(
        "--seconds", min=0.1, max=86400.0, metavar="S", help="End after S seconds. Default: until Ctrl-C."
    ),
]


@topic_app.command("list")
def topic_list(
    *,
    seconds: Listen = 2.0,
    as_json: Json = False,
    config: Config = None,
    endpoint: Endpoint = None,
    keys_dir: KeysPath = None,
    state_dir: StatePath = None,
) -> None:
    """List all topics with their types, permitted writers, actual writers and rates, then all other keys."""

    def run() -> int:
        from lifeline.inspection.topic import show_list  # noqa: PLC0415

        show_list(running(config, endpoint, state_dir, keys_dir), seconds, as_json=as_json)

    exit_with(run)


@topic_app.command("info")
def topic_info(
    *,
    key: Name,
    seconds: Listen = 2.0,
    as_json: Json = False,
    config: Config = None,
    endpoint: Endpoint = None,
    keys_dir: KeysPath = None,
    state_dir: StatePath = None,
) -> None:
    """Print the writers and readers of a topic. Exit 1 if it has more writers than permitted."""

    def run() -> int:
        from lifeline.inspection.topic import show_info  # noqa: PLC0415

        show_info(running(config, endpoint, state_dir, keys_dir), key, seconds, as_json=as_json)

    exit_with(run)


@topic_app.command("type")
def topic_type(
    *,
    key: Name,
    full: Annotated[bool, typer.Option("--full", help="Also print the definition.")] = False,
    as_json: Json = False,
    config: Config = None,
    endpoint: Endpoint = None,
    keys_dir: KeysPath = None,
    state_dir: StatePath = None,
) -> None:
    """Print the ROS 2 type of a topic."""

    def run() -> int:
        from lifeline.inspection.topic import show_type  # noqa: PLC0415

        show_type(running(config, endpoint, state_dir, keys_dir), key, full=full, as_json=as_json)

    exit_with(run)


@topic_app.command("echo")
def topic_echo(
    *,
    keys: Names,
    once: Annotated[bool, typer.Option("--once", help="Print one message and exit.")] = False,
    field: Annotated[
        str, typer.Option("--field", metavar="PATH", help="Print only a field, such as linear.x or ranges.0.")
    ] = "",
    as_csv: Annotated[bool, typer.Option("--csv", help="Print CSV, with a header.")] = False,
    as_json: Json = False,
    config: Config = None,
    endpoint: Endpoint = None,
    keys_dir: KeysPath = None,
    state_dir: StatePath = None,
) -> None:
    """Print the messages of topics as YAML, until Ctrl-C."""

    def run() -> int:
        from lifeline.inspection.topic_stream import Echo, echo  # noqa: PLC0415

        echo(running(config, endpoint, state_dir, keys_dir), keys, Echo(once, field, as_csv, as_json))

    exit_with(run)


@topic_app.command("hz")
def topic_hz(
    *,
    keys: Names,
    seconds: Until = None,
    as_json: Json = False,
    config: Config = None,
    endpoint: Endpoint = None,
    keys_dir: KeysPath = None,
    state_dir: StatePath = None,
) -> None:
    """Measure the rates of topics, and the gaps between messages. Exit 1 if nothing was heard."""

    def run() -> int:
        from lifeline.inspection.topic_stream import measure, rate_report  # noqa: PLC0415

        measure(running(config, endpoint, state_dir, keys_dir), keys, rate_report, seconds, as_json=as_json)

    exit_with(run)


@topic_app.command("bw")
def topic_bw(
    *,
    keys: Names,
    seconds: Until = None,
    as_json: Json = False,
    config: Config = None,
    endpoint: Endpoint = None,
    keys_dir: KeysPath = None,
    state_dir: StatePath = None,
) -> None:
    """Measure the bandwidth of topics. Exit 1 if nothing was heard."""

    def run() -> int:
        from lifeline.inspection.topic_stream import measure, size_report  # noqa: PLC0415

        measure(running(config, endpoint, state_dir, keys_dir), keys, size_report, seconds, as_json=as_json)

    exit_with(run)


@topic_app.command("delay")
def topic_delay(
    *,
    keys: Names,
    seconds: Until = None,
    as_json: Json = False,
    config: Config = None,
    endpoint: Endpoint = None,
    keys_dir: KeysPath = None,
    state_dir: StatePath = None,
) -> None:
    """Measure the ages of messages at arrival, from the senders' stamps. Exit 1 if nothing was heard."""

    def run() -> int:
        from lifeline.inspection.topic_stream import age_report, measure  # noqa: PLC0415

        measure(running(config, endpoint, state_dir, keys_dir), keys, age_report, seconds, as_json=as_json)

    exit_with(run)


@topic_app.command("pub")
def topic_pub(
    *,
    key: Annotated[
        str,
        typer.Argument(
            metavar="KEY",
            help="Name of a topic, such as estop or path/cmd_vel.",
            autocompletion=topic_names,
        ),
    ],
    message: Annotated[
        str,
        typer.Argument(metavar="YAML", help="The message, such as '{linear: {x: 0.1}}'; the rest is zero."),
    ],
    rate: Annotated[
        float | None,
        typer.Option("--rate", min=0.01, max=500.0, metavar="HZ", help="Publish at this rate until Ctrl-C."),
    ] = None,
    once: Annotated[bool, typer.Option("--once", help="Publish one message and exit.")] = False,
    config: Config = None,
    endpoint: Endpoint = None,
    keys_dir: KeysPath = None,
    state_dir: StatePath = None,
) -> None:
    """Publish an e-stop, an obstacle, or the commands of a command source that no other program holds.

    The commands of a source are sent until Ctrl-C, after 1 s of zero, which arms the source.
    """

    def run() -> int:
        from lifeline.inspection.topic_publish import publish  # noqa: PLC0415

        publish(running(config, endpoint, state_dir, keys_dir), key, message, rate, once=once)

    exit_with(run)


@node_app.command("list")
def node_list(
    *,
    as_json: Json = False,
    config: Config = None,
    endpoint: Endpoint = None,
    keys_dir: KeysPath = None,
    state_dir: StatePath = None,
) -> None:
    """List all nodes with their processes. A program without a liveliness token is listed by its program name."""

    def run() -> int:
        from lifeline.inspection.node import show_list  # noqa: PLC0415

        show_list(running(config, endpoint, state_dir, keys_dir), as_json=as_json)

    exit_with(run)


@node_app.command("info")
def node_info(
    *,
    node: Annotated[
        str,
        typer.Argument(metavar="NODE", help="Name, pid or session id of a node.", autocompletion=node_names),
    ],
    seconds: Listen = 2.0,
    as_json: Json = False,
    config: Config = None,
    endpoint: Endpoint = None,
    keys_dir: KeysPath = None,
    state_dir: StatePath = None,
) -> None:
    """Print a node's process, and the topics that it writes, reads and serves, with their rates."""

    def run() -> int:
        from lifeline.inspection.node import show_info  # noqa: PLC0415

        show_info(running(config, endpoint, state_dir, keys_dir), node, seconds, as_json=as_json)

    exit_with(run)


def graph(
    *,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help="Write a drawing (.svg, .png) or a Graphviz file (.dot)."),
    ] = None,
    seconds: Listen = 2.0,
    as_json: Json = False,
    config: Config = None,
    endpoint: Endpoint = None,
    keys_dir: KeysPath = None,
    state_dir: StatePath = None,
) -> None:
    """Show which nodes communicate, from the hub's sessions and the received messages."""

    def run() -> int:
        from lifeline.inspection.graph import show_graph  # noqa: PLC0415

        show_graph(running(config, endpoint, state_dir, keys_dir), out, seconds, as_json=as_json)

    exit_with(run)


def doctor(
    *,
    seconds: Listen = 3.0,
    as_json: Json = False,
    config: Config = None,
    endpoint: Endpoint = None,
    keys_dir: KeysPath = None,
    state_dir: StatePath = None,
) -> None:
    """Explain why the robot does not move, or why the system cannot start. Exit 1 if there is a problem."""

    def run() -> int:
        from deploy.stack.statedir import StateDir  # noqa: PLC0415
        from lifeline.inspection.doctor import doctor as examine  # noqa: PLC0415

        launch = running(config, endpoint, state_dir, keys_dir)
        examine(launch, StateDir.choose(state_dir), seconds, as_json=as_json)

    exit_with(run)
