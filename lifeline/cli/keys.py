"""The definitions of `lifeline keys`. Each command imports its modules only when it runs."""

from pathlib import Path
from typing import Annotated

import typer

from lifeline.command import Json, exit_with, print_json, say
from wire.roles import ANY, Role

keys_app = typer.Typer(
    help="Make the keys and certificates for links between computers: endpoints tls/ and quic/ accept no others.\n\n"
    "Begin on one computer that only you use: `keys init`, then `keys issue robot7 --role supervisor --host robot7` and "
    "`keys issue alice --role operator`. Copy each bundle to its computer, and name it there with --keys or "
    "\\[bus] keys.",
    no_args_is_help=True,
)

KeysFolder = Annotated[
    Path | None,
    typer.Option(
        "--keys",
        metavar="DIR",
        help="Folder of the authority, with all keys. Default: ~/.config/lifeline/keys.",
    ),
]
Name = Annotated[
    str,
    typer.Argument(
        metavar="NAME", help="Person or computer, such as alice or robot7; part of the file names."
    ),
]


@keys_app.command("init")
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
    """Make an authority: the key that signs all certificates. Keep its folder on one computer, and back it up."""

    def run() -> int:
        from deploy.keys.commands import init  # noqa: PLC0415

        made = init(keys, replace=replace)
        if as_json:
            print_json(made)
        else:
            say(f"the authority is in {made['keys']}; next: `lifeline keys issue NAME --role ROLE`")
        return 0

    exit_with(run)


@keys_app.command("issue")
def keys_issue(
    *,
    name: Name,
    role: Annotated[
        Role | None,
        typer.Option(
            "--role",
            help="What it may do: supervisor (the hub), base (wheels and odometry), sensor, operator (drive, stop, reset), "
            "estop (stop), viewer (read), router (passes messages on). Default: as before, for a name that has a certificate.",
        ),
    ] = None,
    robot: Annotated[
        str | None,
        typer.Option(
            "--robot",
            metavar="NAMESPACE",
            help=f"Namespace of the robot; `{ANY}` for all robots. Default: as before, else robot.",
        ),
    ] = None,
    host: Annotated[
        list[str] | None,
        typer.Option(
            "--host",
            metavar="HOST",
            help="With --role supervisor or router: host name or address by which others reach it, in addition to localhost, "
            "127.0.0.1 and ::1; repeat for several. Default: as before.",
        ),
    ] = None,
    days: Annotated[
        float, typer.Option("--days", min=0.01, max=366.0, metavar="N", help="Lifetime in days.")
    ] = 30.0,
    keys: KeysFolder = None,
    as_json: Json = False,
) -> None:
    """Issue or renew a certificate, and write the bundle to copy to the other computer.

    The bundle has the authority's certificate, the certificate and its private key. Restart a supervisor or a router after a
    renewal; all others read theirs when they connect.
    """

    def run() -> int:
        from deploy.keys.commands import issue, issued_sentences  # noqa: PLC0415
        from deploy.keys.register import Request  # noqa: PLC0415

        hosts = None if host is None else tuple(host)
        issued = issue(keys, Request(name, role, robot, hosts), days * 86400.0)
        if as_json:
            print_json(issued)
        else:
            for sentence in issued_sentences(issued):
                say(sentence)
        return 0

    exit_with(run)


@keys_app.command("list")
def keys_list(*, keys: KeysFolder = None, as_json: Json = False) -> None:
    """List the certificates with role, robot, days left and revocation; warn if one ends within 3 days."""

    def run() -> int:
        from deploy.keys.commands import show, table, to_json  # noqa: PLC0415

        found = table(keys)
        if as_json:
            print_json(to_json(found))
        else:
            show(found)
        return 0

    exit_with(run)


@keys_app.command("revoke")
def keys_revoke(*, name: Name, keys: KeysFolder = None, as_json: Json = False) -> None:
    """Refuse further certificates to a name, and print until when the present one still connects."""

    def run() -> int:
        from deploy.keys.commands import revoke, revoked_sentence  # noqa: PLC0415

        revoked = revoke(keys, name)
        if as_json:
            print_json(revoked)
        else:
            say(revoked_sentence(revoked))
        return 0

    exit_with(run)
