"""The operator's command `lifeline`. What a command needs is imported when it runs: `--help` is quick."""

import os
import sys
import traceback
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Annotated, NoReturn

import typer

from deploy.errors import EXIT_REFUSED, DeployError

app = typer.Typer(
    name="lifeline",
    help="A robot that moves only while its lifeline holds.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

Config = Annotated[
    Path | None, typer.Option("--config", metavar="FILE", help="robot.toml; without it, deploy/robot.toml")
]
Endpoint = Annotated[
    str | None,
    typer.Option(
        "--endpoint", metavar="tcp/HOST:PORT", help="where the supervisor listens; without it, as in FILE"
    ),
]
StatePath = Annotated[
    Path | None,
    typer.Option(
        "--state-dir",
        metavar="DIR",
        help="socket, pid file and logs of a running stack; without it, $LIFELINE_STATE_DIR or .lifeline",
    ),
]


@app.command()
def up(
    *,
    config: Config = None,
    endpoint: Endpoint = None,
    state_dir: StatePath = None,
    detach: Annotated[bool, typer.Option("--detach", help="leave it running, without teleop")] = False,
    viewer: Annotated[
        bool | None,
        typer.Option("--viewer/--no-viewer", help="MuJoCo's window; without it, where there is a display"),
    ] = None,
) -> None:
    """Start sim and supervisor, open teleop in this terminal, and take everything down when it ends."""

    def run() -> int:
        from deploy import up as command  # noqa: PLC0415
        from deploy.launch import Launch  # noqa: PLC0415
        from deploy.statedir import StateDir  # noqa: PLC0415

        sim_options = {None: "", True: "--viewer", False: "--no-viewer"}[viewer]
        launch = Launch.read(config, endpoint, sim_options=sim_options)
        return command.up(StateDir.choose(state_dir), launch, _say, detach=detach)

    _exit_with(run)


@app.command()
def down(*, state_dir: StatePath = None) -> None:
    """Stop everything that belongs to the state directory."""

    def run() -> int:
        from deploy import up as command  # noqa: PLC0415
        from deploy.statedir import StateDir  # noqa: PLC0415

        command.down(StateDir.choose(state_dir), _say)
        return 0

    _exit_with(run)


@app.command()
def status(
    *,
    config: Config = None,
    endpoint: Endpoint = None,
    state_dir: StatePath = None,
    as_json: Annotated[bool, typer.Option("--json", help="for machines")] = False,
) -> None:
    """One look. Exit code 0: running; 1: partly; 3: nothing runs."""

    def run() -> int:
        from deploy.launch import Launch  # noqa: PLC0415
        from deploy.statedir import StateDir  # noqa: PLC0415
        from deploy.status import show_status  # noqa: PLC0415

        state = StateDir.choose(state_dir)
        running = Launch.running(state) if config is None and endpoint is None else None
        return show_status(state, running or Launch.read(config, endpoint), as_json=as_json)

    _exit_with(run)


@app.command()
def demo(
    *,
    quick: Annotated[bool, typer.Option("--quick", help="fewer repetitions")] = False,
    viewer: Annotated[bool, typer.Option("--viewer", help="with MuJoCo's window")] = False,
) -> None:
    """Drive, break things, and print what was measured. Exit code 1: a promise was broken."""

    def run() -> int:
        from deploy.demo import play  # noqa: PLC0415

        return play(_say, quick=quick, viewer=viewer)

    _exit_with(run)


@app.command()
def replay_decision(
    *, file: Annotated[Path, typer.Argument(metavar="FILE", help="a black box: blackbox/*.jsonl.gz")]
) -> None:
    """Run the law once more over what led to a stop. Exit code 1: it decides otherwise than it did."""

    def run() -> int:
        from deploy.replay import replay_decision  # noqa: PLC0415

        return replay_decision(file)

    _exit_with(run)


def _say(sentence: str) -> None:
    print(f"lifeline: {sentence}", flush=True)


def _exit_with(run: Callable[[], int]) -> NoReturn:
    """Run a command to its exit code; what the operator can mend is one sentence."""
    try:
        code = run()
    except DeployError as error:
        print(f"lifeline: {error}", file=sys.stderr)
        code = EXIT_REFUSED
    except KeyboardInterrupt as interrupt:
        code = getattr(interrupt, "exit_code", 130)
    raise typer.Exit(code)


def main() -> NoReturn:
    """End the process for certain: an interpreter that ends with an open session can hang."""
    code = 1
    try:
        app()
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
    except Exception:  # noqa: BLE001 - the last stop before the process ends
        traceback.print_exc()
    finally:
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError):
                stream.flush()
        os._exit(code)


if __name__ == "__main__":
    main()
