"""What all commands share: their common options, the decorators that declare them, and how a command ends.

A declaration in cli/ has the options of a command and its help text, and imports its implementation when it
runs, which keeps `lifeline --help` fast.
"""

from collections.abc import Callable
from functools import wraps
from inspect import Signature, signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, NoReturn

import typer
from typer.core import TyperArgument, TyperOption

from deploy.stack.console import note
from deploy.stack.errors import EXIT_REFUSED, DeployError
from wire.host.installation import how_to_install, missing_extra
from wire.host.process_limits import limit_of

if TYPE_CHECKING:
    from deploy.stack.launch import Launch
    from deploy.stack.statedir import StateDir

# The help shows only our metavar of a value: Typer would add Python's types, such as <str> beside NAME.
TyperArgument.display_type_rich = lambda self, ctx: None  # noqa: ARG005
TyperOption.display_type_rich = lambda self, ctx: self.metavar  # noqa: ARG005

Run = Callable[..., int | None]
"""The function of a command. It returns the exit code; None is 0."""
ROBOT_PANEL = "Robot and connection"
"""The panel of a command's help with the options that name a robot or the connection to it."""


def option(flag: str, metavar: str, text: str, **more: Any) -> Any:  # noqa: ANN401 - as Typer declares it
    """Declare an option with a value: its flag, the name of its value and its help."""
    return typer.Option(flag, metavar=metavar, help=text, **more)


def argument(metavar: str, text: str, **more: Any) -> Any:  # noqa: ANN401 - as Typer declares it
    """Declare an argument: its name and its help."""
    return typer.Argument(metavar=metavar, help=text, **more)


Config = Annotated[
    Path | None,
    option(
        "--config", "FILE", "Configuration file. Default: deploy/robot.toml.", rich_help_panel=ROBOT_PANEL
    ),
]
Endpoint = Annotated[
    str | None,
    option(
        "--endpoint",
        "tcp/HOST:PORT",
        "Address on which the supervisor listens. Default: the one in the configuration.",
        rich_help_panel=ROBOT_PANEL,
    ),
]
KeysPath = Annotated[
    Path | None,
    option(
        "--keys",
        "DIR",
        "Bundle of this computer's certificate and key, for endpoints quic/ and tls/. Default: the one in the configuration.",
        rich_help_panel=ROBOT_PANEL,
    ),
]
StatePath = Annotated[
    Path | None,
    option(
        "--state-dir",
        "DIR",
        "Directory of the logs, the black boxes and the e-stop record. Default: $LIFELINE_STATE_DIR, else .lifeline in the checkout or ~/.local/state/lifeline.",
        rich_help_panel=ROBOT_PANEL,
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON.")]
ResultJson = Annotated[
    bool, typer.Option("--json", help="Print only the result, as JSON; progress goes to standard error.")
]


class Robot(NamedTuple):
    """The robot that a command is about."""

    launch: "Launch"
    """How to reach it."""
    state: "StateDir"
    """The state directory of this computer."""

    @classmethod
    def find(
        cls,
        *,
        config: Config = None,
        endpoint: Endpoint = None,
        keys_dir: KeysPath = None,
        state_dir: StatePath = None,
    ) -> "Robot":
        """Return the robot that the options name, else the running one of the state directory, else the default."""
        from deploy.stack.launch import Launch  # noqa: PLC0415
        from deploy.stack.statedir import StateDir  # noqa: PLC0415

        state = StateDir.choose(state_dir)
        return cls(Launch.find(state, config, endpoint, keys_dir), state)


def command(
    app: typer.Typer, name: str | None = None, *, context_settings: dict[str, object] | None = None
) -> Callable[[Run], Run]:
    """Add a command to a group. By default, it has the function's name."""

    def add(run: Run) -> Run:
        @wraps(run)
        def run_and_exit(**options: object) -> NoReturn:
            exit_with(lambda: run(**options))

        app.command(name, context_settings=context_settings)(run_and_exit)
        return run

    return add


def robot_command(
    app: typer.Typer,
    name: str | None = None,
    *,
    find: Callable[..., Robot] = Robot.find,
    context_settings: dict[str, object] | None = None,
) -> Callable[[Run], Run]:
    """Add a command about one robot: its function receives the robot, and the parameters of `find` become its last options."""
    naming = signature(find).parameters

    def add(run: Run) -> Run:
        @wraps(run)
        def run_with_robot(**options: object) -> int | None:
            robot = find(**{option: options.pop(option) for option in naming})
            return run(robot, **options)

        own = [one for one in signature(run).parameters.values() if one.name != "robot"]
        run_with_robot.__signature__ = Signature([*own, *naming.values()])  # pyright: ignore[reportAttributeAccessIssue]
        return command(app, name, context_settings=context_settings)(run_with_robot)

    return add


def exit_with(run: Callable[[], int | None]) -> NoReturn:
    """Run a command and exit with its code; print each error that the operator can correct as one sentence."""
    try:
        code = run() or 0
    except DeployError as error:
        note(str(error))
        code = error.exit_code
    except ModuleNotFoundError as error:
        extra = missing_extra(error)
        if extra is None:
            raise
        note(f"this needs an extra: {how_to_install(extra)}")
        code = EXIT_REFUSED
    except (OSError, MemoryError, RuntimeError) as error:
        sentence = limit_of(error)
        if sentence is None:
            raise
        note(sentence)
        code = EXIT_REFUSED
    except KeyboardInterrupt as interrupt:
        code = getattr(interrupt, "exit_code", 130)
    raise typer.Exit(code)
