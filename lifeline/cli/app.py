"""The command `lifeline`: its groups of commands in the order of its help, and how its process ends.

The commands are in drive.py, look.py, stops.py, prove.py and sites.py, one file for each panel of the help.
"""

import os
import re
import sys
import traceback
from contextlib import suppress
from io import TextIOWrapper
from typing import Annotated, NoReturn

import typer

from deploy.stack.errors import DeployError, default_until_handled
from lifeline.cli import drive, look, prove, sites, stops
from lifeline.command import argument, command
from wire.host.streams import open_closed_streams

app = typer.Typer(
    name="lifeline",
    help="A safety supervisor for teleoperated robots: start it, inspect it, inject faults, and replay its stops.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)
shell_app = typer.Typer()
PARTS = {
    "Drive": drive.app,
    "Look": look.app,
    "Understand a stop": stops.app,
    "Prove": prove.app,
    "Sites": sites.app,
    "Shell": shell_app,
}
"""The panels of the help, with their commands."""

SIZE = re.compile("[1-9][0-9]{0,3}")
"""Of a terminal, in characters."""

COMPLETED = {
    "bash": "",
    # Typer's script needs compdef, which a shell without a completion system does not have.
    "zsh": "(( $+functions[compdef] )) || { autoload -Uz compinit && compinit }\n",
    "fish": "",
}
"""The shells with completion, and what precedes Typer's script."""


@app.callback(invoke_without_command=True)
def lifeline(
    *,
    version: Annotated[bool, typer.Option("--version", help="Show the version and exit.")] = False,
) -> None:
    if version:
        from importlib.metadata import version as version_of

        print(f"lifeline {version_of('lifeline')}")
        raise typer.Exit


@command(shell_app)
def completion(
    *,
    shell: Annotated[str, argument("SHELL", "bash, zsh or fish.", autocompletion=lambda: list(COMPLETED))],
) -> None:
    """Print a shell's completion script; evaluate it in ~/.bashrc, ~/.zshrc or config.fish.

    bash, zsh: source <(lifeline completion bash). fish: lifeline completion fish | source.
    """
    from typer.completion import get_completion_script  # pyright: ignore[reportPrivateImportUsage]

    if shell not in COMPLETED:
        raise DeployError(f"there is no completion for {shell!r}; there is one for {', '.join(COMPLETED)}")
    script = get_completion_script(prog_name="lifeline", complete_var="_LIFELINE_COMPLETE", shell=shell)
    print(f"{COMPLETED[shell]}{script}")


for title, part in PARTS.items():
    for listed in (*part.registered_commands, *part.registered_groups):
        listed.rich_help_panel = title
    app.add_typer(part)


def _adapt_to_terminal() -> None:
    """Replace characters that the output cannot encode, and ignore sizes of a terminal that no text fits."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")
    for name in ("COLUMNS", "LINES"):
        if SIZE.fullmatch(os.environ.get(name, "")) is None:
            os.environ.pop(name, None)


def main() -> NoReturn:
    """Run the command, and exit without the interpreter's shutdown, which can hang if a session is open."""
    code = 1
    default_until_handled()
    open_closed_streams()
    _adapt_to_terminal()
    try:
        app(prog_name="lifeline")
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
    except Exception:  # noqa: BLE001 - os._exit prints no traceback
        traceback.print_exc()
    finally:
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError):
                stream.flush()
        os._exit(0 if "LIFELINE_UNDER_MAKE" in os.environ else code)


if __name__ == "__main__":
    main()
