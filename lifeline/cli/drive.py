"""The commands that start, drive and stop a robot: up, down, teleop, estop, station, path, ros2."""

from importlib.resources import files
from pathlib import Path
from typing import Annotated

import typer

from deploy.stack.console import note, print_json, say
from lifeline.command import (
    Config,
    Endpoint,
    KeysPath,
    ResultJson,
    Robot,
    StatePath,
    argument,
    command,
    option,
    robot_command,
)
from wire.host.installation import require

app = typer.Typer()
path_app = typer.Typer(
    help="Drive the robot along a path. A stop, and usually a key press in teleop, pauses it; Enter continues. A motion command from teleop always takes over.",
    no_args_is_help=True,
)
ros2_app = typer.Typer(
    help="Run ROS 2 programs under the supervisor, and check the base of a ROS 2 robot.", no_args_is_help=True
)
app.add_typer(path_app, name="path")
app.add_typer(ros2_app, name="ros2")

Speed = Annotated[float, option("--speed", "V", "Maximum speed in m/s.", min=0.05, max=1.0)]
Laps = Annotated[int, option("--laps", "N", "Number of laps.", min=1, max=1000)]
Port = Annotated[int, option("--port", "N", "Port of the station's page.", min=1024, max=65535)]
Open = Annotated[
    bool,
    typer.Option(
        "--open",
        help="Serve the station's page to the local network, over TLS with the bundle of --keys. Default: only to this computer.",
    ),
]
Yes = Annotated[bool, typer.Option("--yes", help="With --open: do not ask.")]
PassportFile = Annotated[
    Path | None,
    option(
        "--passport",
        "FILE",
        "Show the first sentence of this signed passport of the robot's configuration on the station's page.",
    ),
]
Authority = Annotated[
    Path | None,
    option("--authority", "PEM", "Certificate of the authority of --passport. Default: that of --keys."),
]
PORT = 8470
Clockwise = Annotated[bool, typer.Option("--clockwise", help="Turn right instead of left.")]


@command(app)
def up(
    *,
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
        option(
            "--only", "NODE", "Start only supervisor, sim or ros2, in the background; repeat for several."
        ),
    ] = None,
    station: Annotated[
        bool,
        typer.Option(
            "--station",
            help="Also serve the page of the e-stop station phone, as `lifeline station` does. If the configuration does not name "
            "this station, it is required: the robot moves only while the page is open.",
        ),
    ] = False,
    drive: Annotated[
        bool,
        typer.Option(
            "--drive", help="With --station: drive on the page instead of in teleop. Enter prints a new code."
        ),
    ] = False,
    port: Port = PORT,
    is_open: Open = False,
    yes: Yes = False,
    passport: PassportFile = None,
    authority: Authority = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="With --detach: print the address and teleop's command as JSON.")
    ] = False,
    config: Config = None,
    endpoint: Endpoint = None,
    keys_dir: KeysPath = None,
    state_dir: StatePath = None,
) -> int:
    """Start the robot, open teleop in this terminal, and stop everything when teleop ends.

    With --station --drive, the page drives, and everything stops at Ctrl-C. The robot is supervisor and sim, or supervisor and ros2 if the configuration has a section ros2.
    """
    from deploy.stack.errors import DeployError
    from deploy.stack.launch import Launch
    from deploy.stack.statedir import StateDir
    from deploy.up import up

    sim_options = {None: "", True: "--viewer", False: "--no-viewer"}[viewer]
    launch = Launch.read(config, endpoint, keys_dir, sim_options=sim_options, with_sim=sim)
    if only:
        launch = launch.only(only)
    progress = note if as_json else say
    detach = detach or bool(only)
    if not station:
        given = {"--drive": drive, "--open": is_open, "--passport": passport, "--authority": authority}
        if (first := next(filter(given.get, given), None)) is not None:
            raise DeployError(f"{first} is for the page of a station: add --station")
        return up(StateDir.choose(state_dir), launch, progress, detach=detach, as_json=as_json)
    require("station")
    from lifeline.page_certificate import Page
    from lifeline.station import beside, print_code

    launch = beside(launch, Page("phone", port, is_open, yes, drive, passport, authority))
    return up(
        StateDir.choose(state_dir),
        launch,
        progress,
        detach=detach,
        as_json=as_json,
        show_station=print_code,
    )


@command(app)
def down(*, as_json: ResultJson = False, state_dir: StatePath = None) -> None:
    """Stop all processes that were started with this state directory."""
    from deploy.stack.statedir import StateDir
    from deploy.stack.takedown import down

    stopped = down(StateDir.choose(state_dir), note if as_json else say)
    if as_json:
        print_json(stopped)


@robot_command(
    app,
    context_settings={"allow_extra_args": True, "ignore_unknown_options": True, "help_option_names": []},
)
def teleop(robot: Robot, *, context: typer.Context) -> None:
    """Drive the running robot by keyboard or gamepad in this terminal. `lifeline teleop --help` lists the options."""
    from deploy.up import become_teleop

    become_teleop(robot.launch, context.args)


@robot_command(app)
def estop(
    robot: Robot,
    *,
    name: Annotated[
        str | None,
        option(
            "--name",
            "NAME",
            "Act as the e-stop station of this name in the configuration until q or Ctrl-C: prove its presence, show whether "
            "it is heard, and stop the robot at any key.",
        ),
    ] = None,
) -> int:
    """Press the emergency stop once, or act as an e-stop station. Exit 0 if the supervisor confirms the press, 1 if not, 2 if a certificate is refused, 3 if nothing runs."""
    from lifeline.estop import press, run_station

    return press(robot.launch) if name is None else run_station(robot.launch, name)


@robot_command(app)
def station(
    robot: Robot,
    *,
    name: Annotated[
        str, option("--name", "NAME", "Name of the e-stop station in the configuration.")
    ] = "phone",
    port: Port = PORT,
    is_open: Open = False,
    yes: Yes = False,
    drive: Annotated[
        bool,
        typer.Option(
            "--drive",
            help="Let one page drive the robot, as the command source of teleop, which must not run.",
        ),
    ] = False,
    passport: PassportFile = None,
    authority: Authority = None,
    new_code: Annotated[
        bool, typer.Option("--new-code", help="Only print a new code of the page of `lifeline up --station`.")
    ] = False,
) -> None:
    """Make the browser of a phone an e-stop station: serve a page with one button, until Ctrl-C. It shows the robot, and drives it only with --drive.

    The page opens with a code that counts once, within a minute. The robot stops if the page of a required station closes, hides or hangs.
    """
    require("station")
    from lifeline.page_certificate import Page
    from lifeline.station import print_code, run

    if new_code:
        from deploy.stack.bringup import new_station_address

        print_code(new_station_address(robot.state))
        return
    run(robot.launch, Page(name, port, is_open, yes, drive, passport, authority))


@command(app)
def commission(
    *,
    file: Annotated[Path, argument("FILE", "The robot's configuration, such as robot.toml.")],
    lidar: Annotated[
        str | None, option("--lidar", "NAME", "Lidar that sees the wall. Default: the first.")
    ] = None,
    source: Annotated[
        str, option("--source", "NAME", "Command source to drive as; no other program may use it meanwhile.")
    ] = "path",
    endpoint: Endpoint = None,
    keys_dir: KeysPath = None,
    state_dir: StatePath = None,
) -> None:
    """Drive a new robot for the first time, and measure what the safety law is configured with.

    Start the robot first, with `lifeline up --detach --config FILE`, in a free area with one flat wall. Each step is shown and
    confirmed; any key aborts a drive. The results are written into the section measured of FILE. Exit 1 if it was aborted.
    """
    from commission.commission import commission
    from deploy.stack.launch import Launch
    from deploy.stack.statedir import StateDir

    state = StateDir.choose(state_dir)
    commission(file, Launch.find(state, file, endpoint, keys_dir), source, lidar, Launch.running(state))


@robot_command(path_app, "square")
def path_square(
    robot: Robot,
    *,
    side: Annotated[float, option("--side", "M", "Length of a side in m.", min=0.1, max=50.0)] = 1.5,
    laps: Laps = 1,
    speed: Speed = 0.4,
    clockwise: Clockwise = False,
    as_json: ResultJson = False,
) -> None:
    """Drive a square whose first side begins at the robot and points ahead."""
    from lifeline.path import drive, relative
    from teleop.path.course import square

    drive(relative(square(side, laps, clockwise=clockwise)), robot.launch, speed, as_json=as_json)


@robot_command(path_app, "circle")
def path_circle(
    robot: Robot,
    *,
    radius: Annotated[float, option("--radius", "M", "Radius in m.", min=0.1, max=50.0)] = 0.6,
    laps: Laps = 1,
    speed: Speed = 0.4,
    clockwise: Clockwise = False,
    as_json: ResultJson = False,
) -> None:
    """Drive a circle whose centre is to the side of the robot."""
    from lifeline.path import drive, relative
    from teleop.path.course import circle

    drive(relative(circle(radius, laps, clockwise=clockwise)), robot.launch, speed, as_json=as_json)


@robot_command(path_app, "follow")
def path_follow(
    robot: Robot,
    *,
    file: Annotated[Path, argument("FILE", "A file that `lifeline record` wrote.")],
    in_place: Annotated[
        bool,
        typer.Option(
            "--absolute",
            help="Drive where the path was recorded, by odometry. Default: start at the robot's present pose.",
        ),
    ] = False,
    speed: Speed = 0.4,
    as_json: ResultJson = False,
) -> None:
    """Replay a recorded path, reversing where it reversed."""
    from lifeline.path import absolute, drive, read_poses, relative

    plan = (absolute if in_place else relative)(read_poses(file))
    drive(plan, robot.launch, speed, as_json=as_json)


@robot_command(ros2_app, "exec", context_settings={"allow_interspersed_args": False})
def ros2_exec(
    robot: Robot,
    *,
    command: Annotated[
        list[str], argument("CMD", "After --: the program that commands the robot, and its arguments.")
    ],
    source: Annotated[str, option("--source", "NAME", "Command source of the program.")],
) -> None:
    """Run a program that commands the robot, such as a teleop, and stop the robot as soon as the program ends.

    Exit with the program's own code, or 128 + N if signal N ended it. If this command is killed, so is the program.
    """
    from lifeline.ros2_exec import run

    run(robot.launch, source, command)


@robot_command(ros2_app, "run")
def ros2_run(robot: Robot) -> None:
    """Run the ROS 2 process in this terminal, as `lifeline up` and the service lifeline-ros2 do."""
    from deploy.stack.ros2_program import run

    run(robot.state, robot.launch.config, robot.launch.bus)


@robot_command(ros2_app, "check-base")
def ros2_check_base(
    robot: Robot,
    *,
    yes: Annotated[bool, typer.Option("--yes", help="Move the robot without asking.")] = False,
) -> None:
    """Measure how long the base moves after its commands end. The robot turns on the spot: keep 1 m around it free."""
    from deploy.stack.ros2_program import run

    options = ["--check-base", *(["--yes"] if yes else [])]
    run(robot.state, robot.launch.config, robot.launch.bus, *options)


@command(ros2_app, "profile")
def ros2_profile() -> None:
    """Print a Fast DDS profile for programs on other hosts: their death is detected after 0.3 s instead of 20 s.

    Write it to a file, and start the program with FASTRTPS_DEFAULT_PROFILES_FILE=FILE.
    """
    print((files("ros2") / "fastdds_short_lease.xml").read_text(encoding="utf-8"), end="")
