"""The common options of all commands, and how a command ends."""

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from deploy.stack.errors import EXIT_REFUSED, DeployError
from wire.host.extras import how_to_install, missing_extra

if TYPE_CHECKING:
    from deploy.stack.launch import Launch

Config = Annotated[
    Path | None,
    typer.Option("--config", metavar="FILE", help="Configuration file. Default: deploy/robot.toml."),
]
Endpoint = Annotated[
    str | None,
    typer.Option(
        "--endpoint",
        metavar="tcp/HOST:PORT",
        help="Address on which the supervisor listens. Default: the one in the configuration.",
    ),
]
KeysPath = Annotated[
    Path | None,
    typer.Option(
        "--keys",
        metavar="DIR",
        help="Bundle of this computer's certificate and key, for endpoints quic/ and tls/. Default: the one in the configuration.",
    ),
]
StatePath = Annotated[
    Path | None,
    typer.Option(
        "--state-dir",
        metavar="DIR",
        help="Directory of the logs, the black boxes and the e-stop record. Default: $LIFELINE_STATE_DIR, else .lifeline in the checkout or ~/.local/state/lifeline.",
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON.")]
ResultJson = Annotated[
    bool, typer.Option("--json", help="Print only the result, as JSON; progress goes to standard error.")
]


def running(
    config: Path | None, endpoint: str | None, state_dir: Path | None, keys: Path | None = None
) -> "Launch":
    """Return the connection settings from the command line, else the running stack, else the configuration."""
    from deploy.stack.launch import Launch  # noqa: PLC0415
    from deploy.stack.statedir import StateDir  # noqa: PLC0415

    return Launch.find(StateDir.choose(state_dir), config, endpoint, keys)


def say(sentence: str) -> None:
    print(f"lifeline: {sentence}", flush=True)


def note(sentence: str) -> None:
    """Report progress on standard error; standard output is for the result."""
    print(f"lifeline: {sentence}", file=sys.stderr, flush=True)


def print_json(document: object) -> None:
    """Print a result as one JSON document."""
    print(json.dumps(document, indent=2), flush=True)


def exit_with(run: Callable[[], int]) -> NoReturn:
    """Run a command and exit with its code; print each error that the operator can correct as one sentence."""
    try:
        code = run()
    except DeployError as error:
        from wire.text import printable_lines  # noqa: PLC0415

        print(f"lifeline: {printable_lines(str(error))}", file=sys.stderr)
        code = EXIT_REFUSED
    except ModuleNotFoundError as error:
        extra = missing_extra(error)
        if extra is None:
            raise
        print(f"lifeline: this needs an extra: {how_to_install(extra)}", file=sys.stderr)
        code = EXIT_REFUSED
    except KeyboardInterrupt as interrupt:
        code = getattr(interrupt, "exit_code", 130)
    raise typer.Exit(code)
