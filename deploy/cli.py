"""The operator's command `lifeline`. What a command needs is imported when it runs: `--help` is quick."""

import os
import sys
import traceback
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from deploy.stack.errors import EXIT_REFUSED, DeployError
from wire.extras import how_to_install, missing_extra, require

if TYPE_CHECKING:
    from deploy.stack.launch import Launch

app = typer.Typer(
    name="lifeline",
    help="A robot that moves only while its lifeline holds.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


@app.callback(invoke_without_command=True)
def lifeline(
    *,
    version: Annotated[bool, typer.Option("--version", help="show the version and exit")] = False,
) -> None:
    if version:
        from importlib.metadata import version as version_of  # noqa: PLC0415

        print(f"lifeline {version_of('lifeline')}")
        raise typer.Exit


path_app = typer.Typer(
    help="Let the robot drive along a path. Any stop, and any key of teleop, pauses it; Enter goes on.",
    no_args_is_help=True,
)
app.add_typer(path_app, name="path")

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
        help="socket, pid file and logs of a running stack; without it, $LIFELINE_STATE_DIR, else .lifeline in the checkout or ~/.local/state/lifeline",
    ),
]
Speed = Annotated[float, typer.Option("--speed", min=0.05, max=1.0, metavar="V", help="at most, in m/s")]
Laps = Annotated[int, typer.Option("--laps", min=1, max=1000, metavar="N")]
Clockwise = Annotated[bool, typer.Option("--clockwise", help="to the right instead of to the left")]


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
        from deploy.stack.launch import Launch  # noqa: PLC0415
        from deploy.stack.statedir import StateDir  # noqa: PLC0415

        sim_options = {None: "", True: "--viewer", False: "--no-viewer"}[viewer]
        launch = Launch.read(config, endpoint, sim_options=sim_options)
        return command.up(StateDir.choose(state_dir), launch, _say, detach=detach)

    _exit_with(run)


@app.command()
def down(*, state_dir: StatePath = None) -> None:
    """Stop everything that belongs to the state directory."""

    def run() -> int:
        from deploy import down as command  # noqa: PLC0415
        from deploy.stack.statedir import StateDir  # noqa: PLC0415

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
    """Print the status once. Exit 0 if the stack runs, 1 if a part of it runs, 3 if nothing runs."""

    def run() -> int:
        from deploy.stack.statedir import StateDir  # noqa: PLC0415
        from deploy.status import show_status  # noqa: PLC0415

        launch = _running(config, endpoint, state_dir)
        return show_status(StateDir.choose(state_dir), launch, as_json=as_json)

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
def check(*, file: Annotated[Path, typer.Argument(metavar="FILE", help="a robot.toml")]) -> None:
    """Check a configuration: its lidars, stopping distance, permitted motions and risks.

    Exit 0 if the file is valid without a risk, 1 if a setting creates a risk, 2 if the file is refused.
    A file without a sim section always exits 1: nothing in it proves the deceleration.
    """

    def run() -> int:
        from deploy.check import check  # noqa: PLC0415

        return check(file)

    _exit_with(run)


@app.command()
def replay_decision(
    *, file: Annotated[Path, typer.Argument(metavar="FILE", help="a black box: blackbox/*.jsonl.gz")]
) -> None:
    """Run the law again over the recording of a stop. Exit 1 if any decision differs from the recording."""

    def run() -> int:
        from deploy.replay import replay_decision  # noqa: PLC0415

        return replay_decision(file)

    _exit_with(run)


@app.command()
def faults(
    *,
    virtual: Annotated[bool, typer.Option("--virtual", help="on a virtual clock: hours in minutes")] = False,
    seeds: Annotated[int, typer.Option("--seeds", min=1, metavar="N", help="the seeds from 0 to N-1")] = 200,
    seed: Annotated[
        int | None,
        typer.Option(
            "--seed",
            min=0,
            metavar="K",
            help="with --virtual: run this seed alone and print every event; else: seed of each class's first trial",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE.jsonl", help="a line for each; those in it are not run again"),
    ] = None,
    jobs: Annotated[
        int | None,
        typer.Option("--jobs", min=1, metavar="N", help="processes; without it, one for each core"),
    ] = None,
    classes: Annotated[
        str,
        typer.Option("--classes", metavar="NAME,…", help="of real faults; `teleop_*`: all that begin so"),
    ] = "",
    trials: Annotated[int, typer.Option("--trials", min=1, metavar="N", help="of each real class")] = 3,
    minutes: Annotated[
        float | None,
        typer.Option(
            "--minutes",
            min=0.1,
            metavar="M",
            help="start no real trial after M minutes; exit 1 if a class was not tried",
        ),
    ] = None,
) -> None:
    """Break everything at random moments, and check every promise.

    Exit code 1: one was broken, or a class of faults was not tried because time ran out.
    """

    def run() -> int:
        from deploy.campaign.provenance import signed  # noqa: PLC0415

        if not virtual:
            from deploy.campaign.real import runner  # noqa: PLC0415

            wanted = tuple(name.strip() for name in classes.split(",") if name.strip())
            with signed(out):
                return runner.run(runner.Orders(trials, wanted, seed or 0, out, minutes))
        from deploy.campaign.simulated.runner import campaign, default_jobs, replay  # noqa: PLC0415

        if seed is not None:
            return replay(seed, _say)
        with signed(out):
            return campaign(seeds, jobs or default_jobs(), out, _say)

    _exit_with(run)


@app.command()
def fault_report(
    *,
    files: Annotated[
        list[Path], typer.Argument(metavar="FILE.jsonl…", help="what `lifeline faults --out` wrote; also .gz")
    ],
    html: Annotated[Path, typer.Option("--html", metavar="OUT.html", help="the page to be written")],
) -> None:
    """Render campaign results as an HTML page."""

    def run() -> int:
        from deploy.campaign.report.report import write_report  # noqa: PLC0415

        _say(write_report(files, html))
        return 0

    _exit_with(run)


@app.command()
def soak(
    *,
    hours: Annotated[float, typer.Option("--hours", min=0.001, metavar="H", help="fractions too")] = 1.0,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE.jsonl", help="a line for each ten seconds")
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option("--plot", metavar="FILE.svg", help="memory, descriptors and lateness over time"),
    ] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, metavar="K", help="of the operator")] = 0,
) -> None:
    """Soak test: report growth. Exit 1 if anything grew, or if the robot stopped without a cause."""

    def run() -> int:
        from deploy.campaign.soak.run import Orders  # noqa: PLC0415
        from deploy.campaign.soak.run import soak as drive_about  # noqa: PLC0415

        return drive_about(Orders(hours, out, plot, seed), _say)

    _exit_with(run)


@app.command()
def record(
    *,
    file: Annotated[Path, typer.Argument(metavar="FILE", help="to be written: NAME.mcap")],
    config: Config = None,
    endpoint: Endpoint = None,
    state_dir: StatePath = None,
) -> None:
    """Record everything that is said on the wire, until Ctrl-C; an MCAP file as of rosbag2."""

    def run() -> int:
        from deploy.record import record  # noqa: PLC0415

        record(file, _running(config, endpoint, state_dir))

    _exit_with(run)


@app.command()
def render(
    *,
    out: Annotated[
        Path,
        typer.Option("--out", metavar="FILE", help="a picture (.png), or an animation (.mp4, .webp, .gif)"),
    ],
    scene: Annotated[
        str, typer.Option("--scene", "--layout", metavar="NAME|FILE", help="a layout, or an MJCF file")
    ] = "warehouse",
    hull: Annotated[str, typer.Option("--hull", help="round or rectangular")] = "round",
    camera: Annotated[
        str, typer.Option("--camera", metavar="NAME", help="follow, corner, top, or one of the scene's own")
    ] = "follow",
    size: Annotated[str, typer.Option("--size", metavar="WxH", help="in pixels")] = "1280x720",
    seconds: Annotated[
        float, typer.Option("--seconds", metavar="S", help="how long; a picture shows the end")
    ] = 8.0,
    fps: Annotated[float, typer.Option("--fps", metavar="N", help="frames of each second")] = 15.0,
    drive: Annotated[
        bool, typer.Option("--drive", help="drive at a pillar, under the real safety law, and back out")
    ] = False,
    caption: Annotated[bool, typer.Option(help="mode, speed and what is nearest, in words")] = True,
) -> None:
    """Draw the robot in its hall, without a screen."""

    def run() -> int:
        require("sim")  # before the drawing is set up, which must precede MuJoCo's import
        from deploy.picture import Wanted  # noqa: PLC0415
        from deploy.render import render as draw  # noqa: PLC0415

        _say(draw(Wanted(out, scene, hull, camera, size, seconds, fps, drive, caption)))
        return 0

    _exit_with(run)


@path_app.command("square")
def path_square(
    *,
    side: Annotated[float, typer.Option("--side", min=0.1, max=50.0, metavar="M", help="in m")] = 1.5,
    laps: Laps = 1,
    speed: Speed = 0.4,
    clockwise: Clockwise = False,
    config: Config = None,
    endpoint: Endpoint = None,
    state_dir: StatePath = None,
) -> None:
    """Drive a square; its first side lies ahead of the robot."""

    def run() -> int:
        from deploy.path import drive, relative  # noqa: PLC0415
        from teleop.path.shapes import square  # noqa: PLC0415

        launch = _running(config, endpoint, state_dir)
        drive(relative(square(side, laps, clockwise=clockwise)), launch, speed)

    _exit_with(run)


@path_app.command("circle")
def path_circle(
    *,
    radius: Annotated[float, typer.Option("--radius", min=0.1, max=50.0, metavar="M", help="in m")] = 0.6,
    laps: Laps = 1,
    speed: Speed = 0.4,
    clockwise: Clockwise = False,
    config: Config = None,
    endpoint: Endpoint = None,
    state_dir: StatePath = None,
) -> None:
    """Drive a circle; its centre lies beside the robot."""

    def run() -> int:
        from deploy.path import drive, relative  # noqa: PLC0415
        from teleop.path.shapes import circle  # noqa: PLC0415

        launch = _running(config, endpoint, state_dir)
        drive(relative(circle(radius, laps, clockwise=clockwise)), launch, speed)

    _exit_with(run)


@path_app.command("follow")
def path_follow(
    *,
    file: Annotated[Path, typer.Argument(metavar="FILE", help="what `lifeline record` wrote")],
    in_place: Annotated[
        bool,
        typer.Option("--absolute", help="where it was driven, by odometry; else from where the robot is"),
    ] = False,
    speed: Speed = 0.4,
    config: Config = None,
    endpoint: Endpoint = None,
    state_dir: StatePath = None,
) -> None:
    """Replay a recorded path, reversing where it reversed."""

    def run() -> int:
        from deploy.path import absolute, drive, read_poses, relative  # noqa: PLC0415

        poses = read_poses(file)
        launch = _running(config, endpoint, state_dir)
        drive(absolute(poses) if in_place else relative(poses), launch, speed)

    _exit_with(run)


def _running(config: Path | None, endpoint: str | None, state_dir: Path | None) -> "Launch":
    """How to reach the robot: as the command line says, else the one that runs, else the configuration."""
    from deploy.stack.launch import Launch  # noqa: PLC0415
    from deploy.stack.statedir import StateDir  # noqa: PLC0415

    running = Launch.running(StateDir.choose(state_dir)) if config is None and endpoint is None else None
    return running or Launch.read(config, endpoint)


def _say(sentence: str) -> None:
    print(f"lifeline: {sentence}", flush=True)


def _exit_with(run: Callable[[], int]) -> NoReturn:
    """Run a command to its exit code; what the operator can mend is one sentence."""
    try:
        code = run()
    except DeployError as error:
        print(f"lifeline: {error}", file=sys.stderr)
        code = EXIT_REFUSED
    except ModuleNotFoundError as error:
        extra = missing_extra(error)
        if extra is None:
            raise
        print(f"lifeline: this needs the simulation: {how_to_install(extra)}", file=sys.stderr)
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
