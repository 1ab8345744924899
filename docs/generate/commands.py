"""Write the tables of docs/commands.md.

There is one part for each panel of `lifeline --help`, with one row for each command: its required options and arguments, and the first
paragraph of its help.
"""

from collections.abc import Iterable, Iterator

import typer
from typer.core import TyperArgument, TyperGroup, TyperOption
from typer.main import get_group

from bench.rig.sheet import markdown_table
from docs.generate import sections
from lifeline.cli.app import PARTS as PANELS


def table(panel: typer.Typer) -> str:
    """Return the table of a panel."""
    rows = ([cell.replace("|", "\\|") for cell in row] for row in _rows(get_group(panel), "lifeline"))
    return markdown_table(("command", "does"), ((f"`{usage}`", does) for usage, does in rows))


def _rows(group: TyperGroup, path: str) -> Iterator[tuple[str, str]]:
    """Yield the usage of each command below a group, and one line of help."""
    for name, command in group.commands.items():
        if isinstance(command, TyperGroup):
            yield from _rows(command, f"{path} {name}")
        else:
            does = " ".join((command.help or "").partition("\n\n")[0].split())
            yield " ".join([path, name, *_needed(command.params)]), does


def _needed(parameters: Iterable[object]) -> Iterator[str]:
    """Yield the required options of a command, then its arguments."""
    for one in parameters:
        if isinstance(one, TyperOption) and one.required:
            yield f"{one.opts[0]} {one.metavar}"
    for one in parameters:
        if isinstance(one, TyperArgument):
            yield one.metavar or str(one.name).upper()


PARTS: sections.Parts = {
    title.lower().replace(" ", "-"): lambda panel=panel: table(panel) for title, panel in PANELS.items()
}
"""By the panel's title in lower case, with hyphens."""
