"""The command `lifeline`. Each command imports its modules only when it runs, which keeps `--help` fast."""

import os
import sys
import traceback
from contextlib import suppress
from pathlib import Path
from typing import Annotated, NoReturn

import typer

from deploy.cli_incidents import incidents_app
from deploy.cli_inspection import doctor, graph, node_app, topic_app
from deploy.command import Config, Endpoint, StatePath
from deploy.command import exit_with as _exit_with
from deploy.command import running as _running
from deploy.command import say as _say
from wire.extras import require

app = typer.Typer(
    name="lifeline",
    help="A safety supervisor for teleoperated robots: start it, check it, break it, and replay its stops.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


@app.callback(invoke_without_command=True)
def lifeline(
    *,
    version: Annotated[bool, typer.Option("--version", help="Show the version and exit.")] = False,
) -> None:
    if version:
        from importlib.metadata import version as version_of  # noqa: PLC0415

        print(f"lifeline {version_of('lifeline')}")
        raise typer.Exit


path_app = typer.Typer(
    help="Drive the robot along a path. A stop or a key press in teleop pauses it; Enter continues. A motion command of teleop always takes over.",
    no_args_is_help=True,
)
app.add_typer(path_app, name="path")
app.add_typer(incidents_app, name="incidents")
app.add_typer(topic_app, name="topic")
app.add_typer(node_app, name="node")
app.command()(graph)
app.command()(doctor)

Speed = Annotated[
    float, typer.Option("--speed", min=0.05, max=1.0, metavar="V", help="Maximum speed in m/s.")
]
Laps = Annotated[int, typer.Option("--laps", min=1, max=1000, metavar="N", help="Number of laps.")]
Clockwise = Annotated[bool, typer.Option("--clockwise", help="Turn right instead of left.")]


@app.command()
def up(
    *,
    config: Config = None,
    endpoint: Endpoint = None,
    state_dir: StatePath = None,
    detach: Annotated[
        bool, typer.Option("--detach", help="Start in the background, without teleop.")
    ] = False,
    viewer: Annotated[
        bool | None,
        typer.Option("--viewer/--no-viewer", help="Open MuJoCo's window. Default: only if a display exists."),
    ] = None,
) -> None:
    """Start sim and supervisor, open teleop in this terminal, and stop everything when teleop ends."""

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
    """Stop all processes that were started with this state directory."""

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
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Print the status once. Exit 0 if the stack runs, 1 if a part of it runs, 3 if nothing runs."""

    def run() -> int:
        from deploy.stack.statedir import StateDir  # noqa: PLC0415
        from deploy.status import show_status  # noqa: PLC0415

        launch = _running(config, endpoint, state_dir)
        return show_status(StateDir.choose(state_dir), launch, as_json=as_json)

    _exit_with(run)


@app.command()
def watch(
    *,
    endpoint: Annotated[
        list[str] | None,
        typer.Option(
            "--endpoint",
            metavar="tcp/HOST:PORT",
            help="Address on which a supervisor listens; repeat for several robots.",
        ),
    ] = None,
    config: Annotated[
        list[Path] | None,
        typer.Option(
            "--config", metavar="FILE", help="Configuration file of a robot; repeat for several robots."
        ),
    ] = None,
    state_dir: StatePath = None,
    as_json: Annotated[
        bool,
        typer.Option("--json", help="Print JSON lines, as on a pipe: at least one per second per robot."),
    ] = False,
    once: Annotated[
        bool, typer.Option("--once", help="Print one row per robot and exit: 0 if all answer, 1 or 3 if not.")
    ] = False,
) -> None:
    """Show a live table of one or several robots until Ctrl-C."""

    def run() -> int:
        from deploy.watch import launches  # noqa: PLC0415
        from deploy.watch import watch as show  # noqa: PLC0415

        named = config or endpoint
        robots = launches(config or (), endpoint or ()) if named else [_running(None, None, state_dir)]
        show(robots, as_json=as_json, once=once)

    _exit_with(run)


@app.command()
def metrics(
    *,
    listen: Annotated[
        str,
        typer.Option(
            "--listen", metavar="HOST:PORT", help="Address to serve HTTP on; port 0 chooses a free one."
        ),
    ] = "127.0.0.1:9464",
    config: Config = None,
    endpoint: Endpoint = None,
    state_dir: StatePath = None,
) -> None:
    """Serve counters and timings of a robot to Prometheus, until Ctrl-C."""

    def run() -> int:
        from deploy.metrics import metrics as serve  # noqa: PLC0415

        serve(_running(config, endpoint, state_dir), listen)

    _exit_with(run)


@app.command()
def demo(
    *,
    quick: Annotated[bool, typer.Option("--quick", help="Repeat each fault less often.")] = False,
    viewer: Annotated[bool, typer.Option("--viewer", help="Open MuJoCo's window.")] = False,
) -> None:
    """Drive, inject faults, and print the measurements. Exit 1 if a promise was broken."""

    def run() -> int:
        from deploy.demo import play  # noqa: PLC0415

        return play(_say, quick=quick, viewer=viewer)

    _exit_with(run)


@app.command()
def check(
    *, file: Annotated[Path, typer.Argument(metavar="FILE", help="Configuration file, such as robot.toml.")]
) -> None:
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
    *, file: Annotated[Path, typer.Argument(metavar="FILE", help="A black box file: blackbox/*.jsonl.gz.")]
) -> None:
    """Run the law again over the recording of a stop. Exit 1 if any decision differs from the recording."""

    def run() -> int:
        from deploy.replay import replay_decision  # noqa: PLC0415

        return replay_decision(file)

    _exit_with(run)


@app.command()
def faults(
    *,
    virtual: Annotated[
        bool, typer.Option("--virtual", help="Run on a virtual clock, many times faster than real time.")
    ] = False,
    seeds: Annotated[
        int, typer.Option("--seeds", min=1, metavar="N", help="With --virtual: run the seeds from 0 to N-1.")
    ] = 200,
    seed: Annotated[
        int | None,
        typer.Option(
            "--seed",
            min=0,
            metavar="K",
            help="With --virtual: run only this seed and print every event. Otherwise: the seed of the first trial of each class.",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FILE.jsonl",
            help="Append one line for each trial. Trials that are already in the file are not run again.",
        ),
    ] = None,
    jobs: Annotated[
        int | None,
        typer.Option(
            "--jobs",
            min=1,
            metavar="N",
            help="With --virtual: number of processes. Default: one for each core.",
        ),
    ] = None,
    classes: Annotated[
        str,
        typer.Option(
            "--classes", metavar="NAME,…", help="Run only these classes; `teleop_*` selects by prefix."
        ),
    ] = "",
    trials: Annotated[
        int, typer.Option("--trials", min=1, metavar="N", help="Trials of each class on real processes.")
    ] = 3,
    minutes: Annotated[
        float | None,
        typer.Option(
            "--minutes",
            min=0.1,
            metavar="M",
            help="Start no trial on real processes after M minutes. Exit 1 if a class was not tried by then.",
        ),
    ] = None,
) -> None:
    """Inject every fault at random moments, and check every promise.

    Exit 1 if a promise was broken, or if time ran out before every class of faults was tried.
    """

    def run() -> int:
        if not virtual:
            from deploy.campaign.real import runner  # noqa: PLC0415

            wanted = tuple(name.strip() for name in classes.split(",") if name.strip())
            return runner.run(runner.Orders(trials, wanted, seed or 0, out, minutes))
        from deploy.campaign.simulated.runner import campaign, default_jobs, replay  # noqa: PLC0415

        if seed is not None:
            return replay(seed, _say)
        return campaign(seeds, jobs or default_jobs(), out, _say)

    _exit_with(run)


@app.command()
def fault_report(
    *,
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE.jsonl…", help="Result files of `lifeline faults --out`, also compressed (.gz)."
        ),
    ],
    html: Annotated[Path, typer.Option("--html", metavar="OUT.html", help="The page to write.")],
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
    hours: Annotated[
        float,
        typer.Option("--hours", min=0.001, metavar="H", help="Duration in hours; fractions are allowed."),
    ] = 1.0,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE.jsonl", help="Write one line every 10 s.")
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option("--plot", metavar="FILE.svg", help="Plot memory, descriptors and lateness over time."),
    ] = None,
    seed: Annotated[
        int, typer.Option("--seed", min=0, metavar="K", help="Seed of the simulated operator.")
    ] = 0,
) -> None:
    """Drive for hours and report growth. Exit 1 if a resource grew, or if the robot stopped without a cause."""

    def run() -> int:
        from deploy.campaign.soak.run import Orders  # noqa: PLC0415
        from deploy.campaign.soak.run import soak as drive_about  # noqa: PLC0415

        return drive_about(Orders(hours, out, plot, seed), _say)

    _exit_with(run)


@app.command()
def record(
    *,
    file: Annotated[Path, typer.Argument(metavar="FILE", help="The file to write: NAME.mcap.")],
    config: Config = None,
    endpoint: Endpoint = None,
    state_dir: StatePath = None,
) -> None:
    """Record all messages in an MCAP file, as rosbag2 does, until Ctrl-C."""

    def run() -> int:
        from deploy.record import record  # noqa: PLC0415

        record(file, _running(config, endpoint, state_dir))

    _exit_with(run)


@app.command()
def render(
    *,
    out: Annotated[
        Path,
        typer.Option(
            "--out",
            metavar="FILE",
            help="The file to write: a picture (.png) or an animation (.mp4, .webp, .gif).",
        ),
    ],
    scene: Annotated[
        str,
        typer.Option(
            "--scene", "--layout", metavar="NAME|FILE", help="Name of a layout, or a layout or MJCF file."
        ),
    ] = "warehouse",
    hull: Annotated[
        str, typer.Option("--hull", metavar="SHAPE", help="Hull of the robot: round or rectangular.")
    ] = "round",
    camera: Annotated[
        str,
        typer.Option("--camera", metavar="NAME", help="View: follow, corner, top, or a camera of the scene."),
    ] = "follow",
    size: Annotated[str, typer.Option("--size", metavar="WxH", help="Size in pixels.")] = "1280x720",
    seconds: Annotated[
        float,
        typer.Option("--seconds", metavar="S", help="Simulated duration; a picture shows the last moment."),
    ] = 8.0,
    fps: Annotated[
        float, typer.Option("--fps", metavar="N", help="Frames per second of an animation.")
    ] = 15.0,
    drive: Annotated[
        bool, typer.Option("--drive", help="Drive toward a pillar under the real safety law, and back out.")
    ] = False,
    caption: Annotated[
        bool, typer.Option(help="Print the mode, speed and nearest distance on each frame.")
    ] = True,
) -> None:
    """Render the simulated robot to an image or animation; no display is needed."""

    def run() -> int:
        require("sim")  # before the renderer is chosen, which must precede MuJoCo's import
        from deploy.picture import Wanted  # noqa: PLC0415
        from deploy.render import render as draw  # noqa: PLC0415

        _say(draw(Wanted(out, scene, hull, camera, size, seconds, fps, drive, caption)))
        return 0

    _exit_with(run)


@path_app.command("square")
def path_square(
    *,
    side: Annotated[
        float, typer.Option("--side", min=0.1, max=50.0, metavar="M", help="Length of a side in m.")
    ] = 1.5,
    laps: Laps = 1,
    speed: Speed = 0.4,
    clockwise: Clockwise = False,
    config: Config = None,
    endpoint: Endpoint = None,
    state_dir: StatePath = None,
) -> None:
    """Drive a square whose first side begins at the robot and points ahead."""

    def run() -> int:
        from deploy.path import drive, relative  # noqa: PLC0415
        from teleop.path.shapes import square  # noqa: PLC0415

        launch = _running(config, endpoint, state_dir)
        drive(relative(square(side, laps, clockwise=clockwise)), launch, speed)

    _exit_with(run)


@path_app.command("circle")
def path_circle(
    *,
    radius: Annotated[
        float, typer.Option("--radius", min=0.1, max=50.0, metavar="M", help="Radius in m.")
    ] = 0.6,
    laps: Laps = 1,
    speed: Speed = 0.4,
    clockwise: Clockwise = False,
    config: Config = None,
    endpoint: Endpoint = None,
    state_dir: StatePath = None,
) -> None:
    """Drive a circle whose centre is to the side of the robot."""

    def run() -> int:
        from deploy.path import drive, relative  # noqa: PLC0415
        from teleop.path.shapes import circle  # noqa: PLC0415

        launch = _running(config, endpoint, state_dir)
        drive(relative(circle(radius, laps, clockwise=clockwise)), launch, speed)

    _exit_with(run)


@path_app.command("follow")
def path_follow(
    *,
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A file that `lifeline record` wrote.")],
    in_place: Annotated[
        bool,
        typer.Option(
            "--absolute",
            help="Drive where the path was recorded, by odometry. Default: start at the robot's present pose.",
        ),
    ] = False,
    speed: Speed = 0.4,
    config: Config = None,
    endpoint: Endpoint = None,
    state_dir: StatePath = None,
) -> None:
    """Drive a recorded path again, in reverse where it was driven in reverse."""

    def run() -> int:
        from deploy.path import absolute, drive, read_poses, relative  # noqa: PLC0415

        poses = read_poses(file)
        launch = _running(config, endpoint, state_dir)
        drive(absolute(poses) if in_place else relative(poses), launch, speed)

    _exit_with(run)


def main() -> NoReturn:
    """Run the command, and exit without the interpreter's shutdown, which can hang if a session is open."""
    code = 1
    try:
        app()
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
    except Exception:  # noqa: BLE001 - os._exit prints no traceback
        traceback.print_exc()
    finally:
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError):
                stream.flush()
        os._exit(code)


if __name__ == "__main__":
    main()
