"""The definitions of `lifeline router` and `lifeline fleet`. Each command imports its modules only when it runs."""

from pathlib import Path
from typing import Annotated

import typer

from lifeline.command import Json, KeysPath, exit_with

fleet_app = typer.Typer(
    help="List, watch and stop all robots behind one router. The bundle must be for `any` robot.",
    no_args_is_help=True,
)
RouterEndpoint = Annotated[
    str, typer.Option("--endpoint", metavar="tls/HOST:PORT", help="Address on which the router listens.")
]
Expected = Annotated[
    list[str] | None,
    typer.Option(
        "--expect",
        metavar="NAMESPACE",
        help="A robot that must answer, even if it is not seen; repeat for several.",
    ),
]


@fleet_app.command("list")
def fleet_list(
    *, endpoint: RouterEndpoint, keys_dir: KeysPath = None, expect: Expected = None, as_json: Json = False
) -> None:
    """Print the status of each robot once. Exit 0 if all answer, 1 if one does not, 3 if there is none."""

    def run() -> int:
        from lifeline.watch.fleet import fleet_config, list_robots  # noqa: PLC0415

        return list_robots(fleet_config(endpoint, keys_dir, stops=False), expect or (), as_json=as_json)

    exit_with(run)


@fleet_app.command("watch")
def fleet_watch(
    *, endpoint: RouterEndpoint, keys_dir: KeysPath = None, expect: Expected = None, as_json: Json = False
) -> None:
    """Show a live table of all robots until Ctrl-C, or JSON lines on a pipe."""

    def run() -> int:
        from lifeline.watch.fleet import fleet_config, watch_robots  # noqa: PLC0415

        return watch_robots(fleet_config(endpoint, keys_dir, stops=False), expect or (), as_json=as_json)

    exit_with(run)


@fleet_app.command("stop")
def fleet_stop(
    *, endpoint: RouterEndpoint, keys_dir: KeysPath = None, expect: Expected = None, as_json: Json = False
) -> None:
    """Send an e-stop to each robot until its status confirms it, and list the robots that do not.

    Exit 0 if each robot has confirmed, 1 if one has not, 3 if there is none.
    """

    def run() -> int:
        from lifeline.watch.fleet import fleet_config, stop_robots  # noqa: PLC0415

        return stop_robots(fleet_config(endpoint, keys_dir, stops=True), expect or (), as_json=as_json)

    exit_with(run)


def router(
    *,
    listen: Annotated[
        list[str],
        typer.Option(
            "--listen",
            metavar="tls/HOST:PORT",
            help="Address on which the router listens; repeat for several. tcp/ only on this machine.",
        ),
    ],
    robots: Annotated[
        list[str] | None,
        typer.Option(
            "--robot", metavar="NAMESPACE", help="Namespace of a robot that it serves; repeat for several."
        ),
    ] = None,
    robots_file: Annotated[
        Path | None,
        typer.Option("--robots", metavar="FILE", help="File with the namespace of a robot in each line."),
    ] = None,
    keys_dir: KeysPath = None,
    connect: Annotated[
        list[str] | None,
        typer.Option(
            "--connect",
            metavar="tls/HOST:PORT",
            help="Another router of this site to connect to; repeat for several.",
        ),
    ] = None,
    sources: Annotated[
        list[str] | None,
        typer.Option(
            "--source",
            metavar="NAME",
            help="Name of a command source; repeat for several. Default: teleop, joy, path.",
        ),
    ] = None,
    stations: Annotated[
        list[str] | None,
        typer.Option("--station", metavar="NAME", help="Name of an e-stop station; repeat for several."),
    ] = None,
    print_config: Annotated[
        bool, typer.Option("--print-config", help="Print the same configuration for zenohd, and exit.")
    ] = False,
) -> None:
    """Run a Zenoh router to which robots behind NAT and their operators connect, until Ctrl-C.

    Each robot names the router under `routers` in the section bus; operators, e-stop stations and viewers name it with
    --endpoint. Its bundle has the role router.
    """

    def run() -> int:
        from lifeline.router import print_settings, router_config, run_router  # noqa: PLC0415

        config = router_config(
            listen, connect or (), keys_dir, robots or (), robots_file, sources or (), stations or ()
        )
        return print_settings(config) if print_config else run_router(config)

    exit_with(run)
