"""The definitions of `lifeline ros2`. Each command imports its modules only when it runs."""

from typing import Annotated

import typer

from lifeline.command import Config, Endpoint, KeysPath, StatePath, exit_with, running

ros2_app = typer.Typer(
    help="Run ROS 2 programs under the supervisor, and check the base of a ROS 2 robot.", no_args_is_help=True
)


@ros2_app.command("exec", context_settings={"allow_interspersed_args": False})
def ros2_exec(
    *,
    command: Annotated[
        list[str],
        typer.Argument(
            metavar="CMD", help="After --: the program that commands the robot, and its arguments."
        ),
    ],
    source: Annotated[str, typer.Option("--source", metavar="NAME", help="Command source of the program.")],
    config: Config = None,
    endpoint: Endpoint = None,
    keys_dir: KeysPath = None,
    state_dir: StatePath = None,
) -> None:
    """Run a program that commands the robot, such as a teleop, and stop the robot as soon as the program ends.

    Exit with the program's own code, or 128 + N if signal N ended it. If this command is killed, so is the program.
    """

    def run() -> int:
        from lifeline.ros2_exec import run as hold  # noqa: PLC0415

        hold(running(config, endpoint, state_dir, keys_dir), source, command)

    exit_with(run)


@ros2_app.command("run")
def ros2_run(
    *,
    config: Config = None,
    endpoint: Endpoint = None,
    keys_dir: KeysPath = None,
    state_dir: StatePath = None,
) -> None:
    """Run the ROS 2 process in this terminal, as `lifeline up` and the service lifeline-ros2 do."""

    def run() -> int:
        from deploy.ros2_run import run as run_ros2  # noqa: PLC0415
        from deploy.stack.statedir import StateDir  # noqa: PLC0415

        run_ros2(running(config, endpoint, state_dir, keys_dir), StateDir.choose(state_dir))

    exit_with(run)


@ros2_app.command("check-base")
def ros2_check_base(
    *,
    yes: Annotated[bool, typer.Option("--yes", help="Move the robot without asking.")] = False,
    config: Config = None,
    endpoint: Endpoint = None,
    keys_dir: KeysPath = None,
    state_dir: StatePath = None,
) -> None:
    """Measure how long the base moves after its commands end. The robot turns on the spot: keep 1 m around it free."""

    def run() -> int:
        from deploy.ros2_run import run as run_ros2  # noqa: PLC0415
        from deploy.stack.statedir import StateDir  # noqa: PLC0415

        options = ["--check-base", *(["--yes"] if yes else [])]
        run_ros2(running(config, endpoint, state_dir, keys_dir), StateDir.choose(state_dir), *options)

    exit_with(run)


@ros2_app.command("profile")
def ros2_profile() -> None:
    """Print a Fast DDS profile for programs on other hosts: their death is detected after 0.3 s instead of 20 s.

    Write it to a file, and start the program with FASTRTPS_DEFAULT_PROFILES_FILE=FILE.
    """

    def run() -> int:
        from lifeline.ros2_profile import profile  # noqa: PLC0415

        print(profile(), end="")
        return 0

    exit_with(run)
