"""What holds for every command of `lifeline`."""

from collections.abc import Iterator

import typer.core
import typer.main
from rich.text import Text

from lifeline.cli.app import PARTS, app

WITHOUT_JSON = {
    "completion": "prints a script",
    "commission": "asks a person; `check --json` prints what its result means",
    "passport measure": "asks a person; its result is the record, which is JSON",
    "router": "routes until Ctrl-C; --print-config prints JSON",
    "metrics": "serves HTTP until Ctrl-C",
    "view": "shows pictures; `topic echo --json` prints the messages",
    "ros2 exec": "its output is that of the program which it runs",
    "ros2 run": "its output is that of the ROS 2 process",
    "ros2 check-base": "its output is that of the ROS 2 process",
    "ros2 profile": "prints an XML file",
    "topic pub": "publishes; it has no result",
    "teleop": "becomes teleop",
    "pid": "prints one number",
    "estop": "presses; its result is the exit code",
    "station": "serves a page until Ctrl-C",
}


def commands(
    group: typer.core.TyperGroup, before: tuple[str, ...] = ()
) -> Iterator[tuple[str, typer.core.TyperCommand]]:
    for name, command in group.commands.items():
        if isinstance(command, typer.core.TyperGroup):
            yield from commands(command, (*before, name))
        else:
            assert isinstance(command, typer.core.TyperCommand)
            yield " ".join((*before, name)), command


def all_commands() -> dict[str, typer.core.TyperCommand]:
    group = typer.main.get_command(app)
    assert isinstance(group, typer.core.TyperGroup)
    return dict(commands(group))


def test_every_command_prints_json_except_those_that_have_no_result() -> None:
    without = {
        name
        for name, command in all_commands().items()
        if not any("--json" in parameter.opts for parameter in command.params)
    }
    assert without == set(WITHOUT_JSON)


def test_every_command_and_option_has_a_help_text() -> None:
    for name, command in all_commands().items():
        assert command.help, name
        for parameter in command.params:
            assert getattr(parameter, "help", ""), (name, parameter.name)


def test_every_value_has_a_metavar_and_help_shows_no_type() -> None:
    for name, command in all_commands().items():
        context = typer.Context(command)
        for parameter in command.get_params(context):
            assert isinstance(parameter, typer.core.TyperArgument | typer.core.TyperOption)
            is_flag = isinstance(parameter, typer.core.TyperOption) and parameter.is_flag
            assert is_flag or parameter.metavar, (name, parameter.name)
            assert parameter.display_type_rich(context) in {None, parameter.metavar}, (name, parameter.name)


def test_the_help_begins_with_up_and_each_command_has_a_part() -> None:
    group = typer.main.get_command(app)
    assert isinstance(group, typer.core.TyperGroup)
    assert next(iter(group.commands)) == "up"
    for name, command in group.commands.items():
        assert isinstance(command, typer.core.TyperCommand | typer.core.TyperGroup)
        assert command.rich_help_panel in PARTS, name


def test_no_help_text_loses_words_in_brackets_as_markup() -> None:
    group = typer.main.get_command(app)
    assert isinstance(group, typer.core.TyperGroup)
    texts = [group.help, *(one.help for one in group.commands.values())]
    for command in all_commands().values():
        texts += [command.help, *(getattr(parameter, "help", "") for parameter in command.params)]
    for text in texts:
        assert text is not None
        assert Text.from_markup(text).plain == text.replace(r"\[", "[")
