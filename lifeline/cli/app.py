"""The command `lifeline`. Each command imports its modules only when it runs, which keeps `--help` fast."""

import os
import sys
import traceback
from contextlib import suppress
from pathlib import Path
from typing import Annotated, NoReturn

import typer

from deploy.stack.interrupts import default_until_handled
from lifeline.cli.completion import (
    ANSWER_VARIABLE,
    camera_names,
    class_names,
    hull_names,
    layout_names,
    script,
    shells,
)
from lifeline.cli.fleet import fleet_app, router
from lifeline.cli.incidents import incidents_app
from lifeline.cli.inspection import doctor, graph, node_app, topic_app
from lifeline.cli.keys import keys_app
from lifeline.cli.ros2 import ros2_app
from lifeline.cli.view import view
from lifeline.command import Config, Endpoint, Json, KeysPath, ResultJson, StatePath, print_json
from lifeline.command import exit_with as _exit_with
from lifeline.command import note as _note
from lifeline.command import running as _running
from lifeline.command import say as _say
from wire.host.extras import require

app = typer.Typer(
    name="lifeline",
    help="A safety supervisor for teleoperated robots: start it, inspect it, inject faults, and replay its stops.",
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
    help="Drive the robot along a path. A stop, and usually a key press in teleop, pauses it; Enter continues. A motion command from teleop always takes over.",
    no_args_is_help=True,
)
app.add_typer(path_app, name="path")
app.add_typer(incidents_app, name="incidents")
app.add_typer(topic_app, name="topic")
app.add_typer(node_app, name="node")
app.add_typer(ros2_app, name="ros2")
app.add_typer(keys_app, name="keys")
app.add_typer(fleet_app, name="fleet")
app.command()(graph)
app.command()(doctor)
app.command()(view)
app.command()(router)

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
    keys_dir: KeysPath = None,
    state_dir: StatePath = None,
    detach: Annotated[
        bool, typer.Option("--detach", help="Start in the background, without teleop.")
    ] = False,
    viewer: Annotated[
        bool | None,
        typer.Option("--viewer/--no-viewer", help="Open MuJoCo's window. Default: only if a display exists."),
    ] = None,
    sim: Annotated[
        bool,
        typer.Option(
            "--sim/--no-sim",
            help="Simulate the base. With a section ros2 in the configuration, no sim starts.",
        ),
    ] = True,
    only: Annotated[
        list[str] | None,
        typer.Option(
            "--only",
            metavar="NODE",
            help="Start only supervisor, sim or ros2, in the background; repeat for several.",
        ),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="With --detach: print the address and teleop's command as JSON.")
    ] = False,
) -> None:
    """Start the robot, open teleop in this terminal, and stop everything when teleop ends.

    The robot is supervisor and sim, or supervisor and ros2 if the configuration has a section ros2.
    """

    def run() -> int:
        from deploy import up as command  # noqa: PLC0415
        from deploy.stack.launch import Launch  # noqa: PLC0415
        from deploy.stack.statedir import StateDir  # noqa: PLC0415

        sim_options = {None: "", True: "--viewer", False: "--no-viewer"}[viewer]
        launch = Launch.read(config, endpoint, keys_dir, sim_options=sim_options, with_sim=sim)
        if only:
            launch = launch.only(only)
        say = _note if as_json else _say
        return command.up(
            StateDir.choose(state_dir), launch, say, detach=detach or bool(only), as_json=as_json
        )

    _exit_with(run)


@app.command()
def down(*, state_dir: StatePath = None, as_json: ResultJson = False) -> None:
    """Stop all processes that were started with this state directory."""

    def run() -> int:
        from deploy import down as command  # noqa: PLC0415
        from deploy.stack.statedir import StateDir  # noqa: PLC0415

        stopped = command.down(StateDir.choose(state_dir), _note if as_json else _say)
        if as_json:
            print_json(stopped)
        return 0

    _exit_with(run)


@app.command()
def status(
    *,
    config: Config = None,
    endpoint: Endpoint = None,
    keys_dir: KeysPath = None,
    state_dir: StatePath = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Print the status once. Exit 0 if the stack runs, 1 if a part of it runs, 3 if nothing runs."""

    def run() -> int:
        from deploy.stack.statedir import StateDir  # noqa: PLC0415
        from lifeline.status import show_status  # noqa: PLC0415

        launch = _running(config, endpoint, state_dir, keys_dir)
        return show_status(StateDir.choose(state_dir), launch, as_json=as_json)

    _exit_with(run)


@app.command()
def estop(
    *,
    name: Annotated[
        str | None,
        typer.Option(
            "--name",
            metavar="NAME",
            help="Be the e-stop station of this name in the configuration until q or Ctrl-C: prove its presence, show whether "
            "it is heard, and stop the robot at any key.",
        ),
    ] = None,
    config: Config = None,
    endpoint: Endpoint = None,
    keys_dir: KeysPath = None,
    state_dir: StatePath = None,
) -> None:
    """Press the emergency stop once, or be an e-stop station. Exit 0 if the supervisor confirms the press, 1 if not, 3 if nothing runs."""

    def run() -> int:
        launch = _running(config, endpoint, state_dir, keys_dir)
        if name is not None:
            from lifeline.estop_station import run_station  # noqa: PLC0415

            run_station(launch, name)
        from lifeline.estop_press import press  # noqa: PLC0415

        return press(launch)

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
    keys_dir: KeysPath = None,
    state_dir: StatePath = None,
    as_json: Annotated[
        bool,
        typer.Option(
            "--json", help="Print JSON lines instead of a table; default on a pipe or a dumb terminal."
        ),
    ] = False,
    once: Annotated[
        bool,
        typer.Option(
            "--once", help="Print one row per robot. Exit 0 if all answer, 1 if some do, 3 if none does."
        ),
    ] = False,
) -> None:
    """Show a live table of one or several robots until Ctrl-C."""

    def run() -> int:
        from lifeline.watch.watch import launches  # noqa: PLC0415
        from lifeline.watch.watch import watch as show  # noqa: PLC0415

        named = config or endpoint
        robots = (
            launches(config or (), endpoint or (), keys_dir)
            if named
            else [_running(None, None, state_dir, keys_dir)]
        )
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
    keys_dir: KeysPath = None,
    state_dir: StatePath = None,
) -> None:
    """Serve counters and timings of a robot to Prometheus, until Ctrl-C."""

    def run() -> int:
        from lifeline.watch.metrics import metrics as serve  # noqa: PLC0415

        serve(_running(config, endpoint, state_dir, keys_dir), listen)

    _exit_with(run)


@app.command()
def demo(
    *,
    quick: Annotated[bool, typer.Option("--quick", help="Repeat each fault less often.")] = False,
    viewer: Annotated[bool, typer.Option("--viewer", help="Open MuJoCo's window.")] = False,
    as_json: ResultJson = False,
) -> None:
    """Drive, inject faults, and print the measurements. Exit 1 if a promise was broken."""

    def run() -> int:
        require("sim")  # before anything is announced
        from faults.demo.demo import play  # noqa: PLC0415

        return play(_note if as_json else _say, quick=quick, viewer=viewer, as_json=as_json)

    _exit_with(run)


@app.command()
def check(
    *,
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Configuration file, such as robot.toml.")],
    as_json: Json = False,
) -> None:
    """Check a configuration: its lidars, stopping distance, permitted motions and risks.

    Exit 0 if the file is valid without a risk, 1 if a setting creates a risk, 2 if the file is refused.
    A file without a sim section always exits 1: nothing in it proves the deceleration.
    """

    def run() -> int:
        from lifeline.check.check import check  # noqa: PLC0415

        return check(file, as_json=as_json)

    _exit_with(run)


@app.command()
def replay_decision(
    *,
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A black box file: blackbox/*.jsonl.gz.")],
    as_json: Json = False,
) -> None:
    """Run the law again over the recording of a stop. Exit 1 if any decision differs from the recording."""

    def run() -> int:
        from lifeline.incidents.replay import replay_decision  # noqa: PLC0415

        return replay_decision(file, as_json=as_json)

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
            "--classes",
            metavar="NAME,…",
            help="Run only these classes; `teleop_*` selects by prefix.",
            autocompletion=class_names,
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
            help="Start no trial on real processes after M minutes. Exit 1 if a class has not been tried by then.",
        ),
    ] = None,
    as_json: ResultJson = False,
) -> None:
    """Inject every fault at random moments, and check every promise.

    Exit 1 if a promise was broken, or if time ran out before every class of faults was tried.
    """

    def run() -> int:
        require("sim")
        if not virtual:
            from faults.real import runner  # noqa: PLC0415

            wanted = tuple(name.strip() for name in classes.split(",") if name.strip())
            return runner.run(runner.Orders(trials, wanted, seed or 0, out, minutes), as_json=as_json)
        from faults.simulated.runner import campaign, default_jobs, replay  # noqa: PLC0415

        if seed is not None:
            return replay(seed, _say, as_json=as_json)
        return campaign(seeds, jobs or default_jobs(), out, _note if as_json else _say, as_json=as_json)

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
    as_json: Json = False,
) -> None:
    """Render campaign results as an HTML page."""

    def run() -> int:
        from faults.report.report import write_report  # noqa: PLC0415

        written = write_report(files, html)
        if as_json:
            print_json(written._asdict())
        else:
            _say(written.sentence)
        return 0

    _exit_with(run)


@app.command()
def record(
    *,
    file: Annotated[Path, typer.Argument(metavar="FILE", help="The file to write: NAME.mcap.")],
    as_json: ResultJson = False,
    config: Config = None,
    endpoint: Endpoint = None,
    keys_dir: KeysPath = None,
    state_dir: StatePath = None,
) -> None:
    """Record all messages in an MCAP file, as rosbag2 does, until Ctrl-C."""

    def run() -> int:
        from lifeline.recording.record import record  # noqa: PLC0415

        record(file, _running(config, endpoint, state_dir, keys_dir), as_json=as_json)

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
            "--scene",
            "--layout",
            metavar="NAME|FILE",
            help="Name of a layout, or a layout or MJCF file.",
            autocompletion=layout_names,
        ),
    ] = "warehouse",
    hull: Annotated[
        str,
        typer.Option(
            "--hull",
            metavar="SHAPE",
            help="Hull of the robot: round or rectangular.",
            autocompletion=hull_names,
        ),
    ] = "round",
    camera: Annotated[
        str,
        typer.Option(
            "--camera",
            metavar="NAME",
            help="View: follow, corner, top, or a camera of the scene.",
            autocompletion=camera_names,
        ),
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
    as_json: Json = False,
) -> None:
    """Render the simulated robot to an image or animation; no display is needed."""

    def run() -> int:
        require("sim")  # before the renderer is chosen, which must precede MuJoCo's import
        from lifeline.render.picture import Wanted  # noqa: PLC0415
        from lifeline.render.render import render as draw  # noqa: PLC0415

        rendered = draw(Wanted(out, scene, hull, camera, size, seconds, fps, drive, caption))
        if as_json:
            print_json(rendered._asdict())
        else:
            _say(rendered.sentence)
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
    as_json: ResultJson = False,
    clockwise: Clockwise = False,
    config: Config = None,
    endpoint: Endpoint = None,
    keys_dir: KeysPath = None,
    state_dir: StatePath = None,
) -> None:
    """Drive a square whose first side begins at the robot and points ahead."""

    def run() -> int:
        from lifeline.path import drive, relative  # noqa: PLC0415
        from teleop.path.course import square  # noqa: PLC0415

        launch = _running(config, endpoint, state_dir, keys_dir)
        drive(relative(square(side, laps, clockwise=clockwise)), launch, speed, as_json=as_json)

    _exit_with(run)


@path_app.command("circle")
def path_circle(
    *,
    radius: Annotated[
        float, typer.Option("--radius", min=0.1, max=50.0, metavar="M", help="Radius in m.")
    ] = 0.6,
    laps: Laps = 1,
    speed: Speed = 0.4,
    as_json: ResultJson = False,
    clockwise: Clockwise = False,
    config: Config = None,
    endpoint: Endpoint = None,
    keys_dir: KeysPath = None,
    state_dir: StatePath = None,
) -> None:
    """Drive a circle whose centre is to the side of the robot."""

    def run() -> int:
        from lifeline.path import drive, relative  # noqa: PLC0415
        from teleop.path.course import circle  # noqa: PLC0415

        launch = _running(config, endpoint, state_dir, keys_dir)
        drive(relative(circle(radius, laps, clockwise=clockwise)), launch, speed, as_json=as_json)

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
    as_json: ResultJson = False,
    config: Config = None,
    endpoint: Endpoint = None,
    keys_dir: KeysPath = None,
    state_dir: StatePath = None,
) -> None:
    """Replay a recorded path, reversing where it reversed."""

    def run() -> int:
        from lifeline.path import absolute, drive, read_poses, relative  # noqa: PLC0415

        poses = read_poses(file)
        launch = _running(config, endpoint, state_dir, keys_dir)
        drive(absolute(poses) if in_place else relative(poses), launch, speed, as_json=as_json)

    _exit_with(run)


@app.command()
def completion(
    *,
    shell: Annotated[str, typer.Argument(metavar="SHELL", help="bash, zsh or fish.", autocompletion=shells)],
) -> None:
    """Print a shell's completion script; evaluate it in ~/.bashrc, ~/.zshrc or config.fish.

    bash, zsh: source <(lifeline completion bash). fish: lifeline completion fish | source.
    """

    def run() -> int:
        print(script(shell))
        return 0

    _exit_with(run)


def main() -> NoReturn:
    """Run the command, and exit without the interpreter's shutdown, which can hang if a session is open."""
    code = 1
    default_until_handled()
    try:
        if ANSWER_VARIABLE in os.environ:
            from typer._completion_classes import completion_init  # noqa: PLC0415

            completion_init()
        app(prog_name="lifeline")
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
