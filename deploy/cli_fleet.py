"""The definitions of `lifeline router` and `lifeline fleet`. Each command imports its modules only when it runs."""

from pathlib import Path
from typing import Annotated

import typer

from deploy.command import KeysPath, exit_with


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
            help="Another router to connect to, such as a central one; repeat for several.",
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
    print_config: Annotated[
        bool, typer.Option("--print-config", help="Print the same configuration for zenohd, and exit.")
    ] = False,
) -> None:
    """Run a Zenoh router to which robots behind NAT and their operators connect, until Ctrl-C.

    Each robot names the router under `routers` in the section bus; operators, e-stop stations and viewers name it with
    --endpoint. Its bundle has the role router.
    """

    def run() -> int:
        from deploy.router import print_settings, router_config, run_router  # noqa: PLC0415

        config = router_config(listen, connect or (), keys_dir, robots or (), robots_file, sources or ())
        return print_settings(config) if print_config else run_router(config)

    exit_with(run)
