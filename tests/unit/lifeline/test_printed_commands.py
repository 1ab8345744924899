"""Each command that a message of the source names is accepted by the command line, with values for its placeholders."""

import ast
import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest
import typer.main
from typer.core import TyperGroup

from lifeline.cli.app import app
from tests.packages import PACKAGES

ROOT = Path(__file__).parents[3]
VALUES = {
    "ROLE": "viewer",
    "{part or Role.VIEWER}": "operator",
    "{server}": "router",
    "{state.option}": "",
    "{seed}": "7",
    "{role}": "estop",
    "{more}": "",
    "{drive}": "",
}
"""Other placeholders can have any text."""
ONLY_NAMED = {
    "lifeline {self.command}",
    "lifeline faults --out",
    "lifeline keys",
    "lifeline keys issue",
    "lifeline record",
    "lifeline ros2 exec",
    "lifeline ros2 exec --source {source}",
}
"""Commands that a message names without arguments, because they run already, or because their help gives the arguments."""


def messages(source: str) -> Iterator[str]:
    """The strings of a module that are no docstrings; an expression in an f-string stands in braces."""
    tree = ast.parse(source)
    skipped = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if id(node) in skipped:
            continue
        if isinstance(node, ast.JoinedStr):
            skipped |= {id(part) for part in node.values}
            yield "".join(
                f"{{{ast.unparse(part.value)}}}"
                if isinstance(part, ast.FormattedValue)
                else ast.literal_eval(part)
                for part in node.values
            )
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value


def printed() -> list[str]:
    sources = (file.read_text() for package in PACKAGES for file in (ROOT / package).rglob("*.py"))
    found = {
        command
        for source in sources
        if "lifeline " in source  # each worker waits for this, and most modules name no command
        for message in messages(source)
        for command in re.findall(r"`(lifeline [^`]+)`", message)
    }
    return sorted(found - ONLY_NAMED)


@pytest.mark.parametrize("command", printed())
def test_each_printed_command_is_accepted(command: str) -> None:
    text = command
    for placeholder, value in VALUES.items():
        text = text.replace(placeholder, value)
    words = shlex.split(re.sub(r"\{[^{}]*\}", "robot7", text))[1:]
    found = typer.main.get_command(app)
    while isinstance(found, TyperGroup):
        found = found.commands[words.pop(0)]
    found.make_context(command, words)
