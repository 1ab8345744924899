"""The commands for sites with several robots and computers: keys, router, fleet."""

from pathlib import Path
from typing import Annotated

import typer

from deploy.stack.console import answer, print_json, say
from lifeline.command import ROBOT_PANEL, Json, KeysPath, argument, command, option
from wire.roles import ANY, Role

app = typer.Typer()
keys_app = typer.Typer(
    help="Make the keys and certificates for links between computers: endpoints tls/ and quic/ accept no others.\n\n"
    "Begin on one computer that only you use: `keys init`, then `keys issue robot7 --role supervisor --host robot7` and "
    "`keys issue alice --role operator`. Copy each bundle to its computer, and name it there with --keys or "
    "\\[bus] keys.",
    no_args_is_help=True,
)
fleet_app = typer.Typer(
    help="List, watch and stop all robots behind one router. The bundle must be for `any` robot.",
    no_args_is_help=True,
)
app.add_typer(keys_app, name="keys")
app.add_typer(fleet_app, name="fleet")

KeysFolder = Annotated[
    Path | None,
    option("--keys", "DIR", "Folder of the authority, with all keys. Default: ~/.config/lifeline/keys."),
]
Name = Annotated[
    str, argument("NAME", "Person or computer, such as alice or robot7; part of the file names.")
]
RouterEndpoint = Annotated[
    str,
    option(
        "--endpoint", "tls/HOST:PORT", "Address on which the router listens.", rich_help_panel=ROBOT_PANEL
    ),
]
Expected = Annotated[
    list[str] | None,
    option("--expect", "NAMESPACE", "A robot that must answer, even if it is not seen; repeat for several."),
]


@command(keys_app, "init")
def keys_init(
    *,
    replace: Annotated[
        bool,
        typer.Option(
            "--replace",
            help="Make a new authority in place of the present one. All its certificates end as soon as the supervisors "
            "have their new bundles and were restarted.",
        ),
    ] = False,
    keys: KeysFolder = None,
    as_json: Json = False,
) -> None:
    """Create a certificate authority: the key that signs all certificates. Keep its folder on one computer, and back it up."""
    from deploy.keys.commands import init

    made = init(keys, replace=replace)
    sentence = f"the authority is in {made['keys']}; next: `lifeline keys issue NAME --role ROLE`"
    answer(made, sentence, as_json=as_json)


@command(keys_app, "issue")
def keys_issue(
    *,
    name: Name,
    role: Annotated[
        Role | None,
        option(
            "--role",
            "ROLE",
            "Permitted role: supervisor (the hub), base (wheels and odometry), sensor, operator (drive, stop, reset), "
            "estop (stop), viewer (read), router (passes messages on). Default: as before, for a name that has a certificate.",
        ),
    ] = None,
    robot: Annotated[
        str | None,
        option(
            "--robot",
            "NAMESPACE",
            f"Namespace of the robot; `{ANY}` for all robots. Default: as before, else robot.",
        ),
    ] = None,
    host: Annotated[
        list[str] | None,
        option(
            "--host",
            "HOST",
            "Host name or address by which others reach a supervisor, a router, or a page of `lifeline station --open` (role estop; operator "
            "with --drive), in addition to localhost, 127.0.0.1 and ::1; repeat for several. Default: as before.",
        ),
    ] = None,
    days: Annotated[float, option("--days", "N", "Lifetime in days.", min=0.01, max=366.0)] = 30.0,
    keys: KeysFolder = None,
    as_json: Json = False,
) -> None:
    """Issue or renew a certificate, and write the bundle to copy to the other computer.

    The bundle has the authority's certificate, the certificate and its private key. Restart a supervisor or a router after a
    renewal; all others read theirs when they connect.
    """
    from deploy.keys.commands import issue, issued_sentences
    from deploy.keys.register import Request

    hosts = None if host is None else tuple(host)
    issued = issue(keys, Request(name, role, robot, hosts), days * 86400.0)
    if as_json:
        print_json(issued)
    else:
        for sentence in issued_sentences(issued):
            say(sentence)


@command(keys_app, "list")
def keys_list(*, keys: KeysFolder = None, as_json: Json = False) -> None:
    """List the certificates with role, robot, days left and revocation; warn if one ends within 3 days."""
    from deploy.keys.commands import show, table, to_json

    found = table(keys)
    if as_json:
        print_json(to_json(found))
    else:
        show(found)


@command(keys_app, "revoke")
def keys_revoke(*, name: Name, keys: KeysFolder = None, as_json: Json = False) -> None:
    """Refuse further certificates to a name, and print how long the current one is still accepted."""
    from deploy.keys.commands import revoke, revoked_sentence

    revoked = revoke(keys, name)
    answer(revoked, revoked_sentence(revoked), as_json=as_json)


@command(app)
def router(
    *,
    listen: Annotated[
        list[str],
        option(
            "--listen",
            "tls/HOST:PORT",
            "Address on which the router listens; repeat for several. tcp/ only on this machine.",
        ),
    ],
    robots: Annotated[
        list[str] | None,
        option("--robot", "NAMESPACE", "Namespace of a robot that it serves; repeat for several."),
    ] = None,
    robots_file: Annotated[
        Path | None, option("--robots", "FILE", "File with the namespace of a robot in each line.")
    ] = None,
    keys_dir: KeysPath = None,
    connect: Annotated[
        list[str] | None,
        option(
            "--connect", "tls/HOST:PORT", "Another router of this site to connect to; repeat for several."
        ),
    ] = None,
    sources: Annotated[
        list[str] | None,
        option(
            "--source", "NAME", "Name of a command source; repeat for several. Default: teleop, joy, path."
        ),
    ] = None,
    stations: Annotated[
        list[str] | None, option("--station", "NAME", "Name of an e-stop station; repeat for several.")
    ] = None,
    print_config: Annotated[
        bool, typer.Option("--print-config", help="Print the same configuration for zenohd, and exit.")
    ] = False,
) -> int:
    """Run a Zenoh router to which robots behind NAT and their operators connect, until Ctrl-C.

    Each robot names the router under `routers` in the section bus; operators, e-stop stations and viewers name it with
    --endpoint. Its bundle has the role router.
    """
    from lifeline.router import print_settings, router_config, run_router

    config = router_config(
        listen, connect or (), keys_dir, robots or (), robots_file, sources or (), stations or ()
    )
    return print_settings(config) if print_config else run_router(config)


@command(fleet_app, "list")
def fleet_list(
    *, endpoint: RouterEndpoint, keys_dir: KeysPath = None, expect: Expected = None, as_json: Json = False
) -> int:
    """Print the status of each robot once. Exit 0 if all answer, 1 if one does not, 3 if there is none."""
    from lifeline.watch.fleet import fleet_config, list_robots

    return list_robots(fleet_config(endpoint, keys_dir, stops=False), expect or (), as_json=as_json)


@command(fleet_app, "watch")
def fleet_watch(
    *, endpoint: RouterEndpoint, keys_dir: KeysPath = None, expect: Expected = None, as_json: Json = False
) -> int:
    """Show a live table of all robots until Ctrl-C, or JSON lines on a pipe."""
    from lifeline.watch.fleet import fleet_config, watch_robots

    return watch_robots(fleet_config(endpoint, keys_dir, stops=False), expect or (), as_json=as_json)


@command(fleet_app, "stop")
def fleet_stop(
    *, endpoint: RouterEndpoint, keys_dir: KeysPath = None, expect: Expected = None, as_json: Json = False
) -> int:
    """Send an e-stop to each robot until its status confirms it, and list the robots that do not.

    Exit 0 if each robot has confirmed, 1 if one has not, 3 if there is none.
    """
    from lifeline.watch.fleet import fleet_config, stop_robots

    return stop_robots(fleet_config(endpoint, keys_dir, stops=True), expect or (), as_json=as_json)
