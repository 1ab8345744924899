"""Find the directory of the black boxes, and a black box by its name."""

from pathlib import Path

from deploy.stack.errors import DeployError
from deploy.stack.launch import Launch
from deploy.stack.statedir import StateDir
from supervisor.blackbox.file import OURS, SUFFIX
from supervisor.config import SupervisorSection
from wire.host.config import ConfigError, absolute
from wire.text import printable

LAST = "last"


def directory_of(launch: Launch, state: StateDir) -> Path:
    """Return the directory of the black boxes.

    Raises:
        DeployError: the configuration is refused.
    """
    configured = launch.section("supervisor", SupervisorSection).black_box_dir
    try:
        return state.path / "blackbox" if configured is None else absolute(Path(configured))
    except ConfigError as error:
        raise DeployError(str(error)) from error


def black_boxes(directory: Path) -> list[Path]:
    """Return the black boxes in a directory in order of time; none if there is no directory.

    Raises:
        DeployError: the directory cannot be read.
    """
    try:
        return sorted(path for path in directory.iterdir() if OURS.fullmatch(path.name))
    except FileNotFoundError:
        return []
    except OSError as error:
        raise DeployError(
            f"cannot read {directory} ({error.strerror}): name another with --state-dir"
        ) from error


def find(directory: Path, name: str) -> Path:
    """Return the black box with a name, a unique beginning of a name, the path of a file, or the last one.

    Args:
        directory: of the black boxes.
        name: as the operator wrote it; the path of a file may be of any type.

    Raises:
        DeployError: there is none, or there are several.
    """
    if "/" in name or Path(name).is_file():
        return Path(name)
    paths = black_boxes(directory)
    if name == LAST and paths:
        return paths[-1]
    wanted = name.removesuffix(SUFFIX)
    found = [path for path in paths if id_of(path) == wanted] or [
        path for path in paths if path.name.startswith(wanted)
    ]
    if len(found) == 1:
        return found[0]
    if not found:
        some = f"{len(paths)} incidents, none of which is {printable(name)!r}" if paths else "no incidents"
        raise DeployError(f"{directory} has {some}: see `lifeline incidents list`")
    raise DeployError(
        f"{len(found)} incidents begin with {printable(name)!r}, such as {id_of(found[0])} and {id_of(found[-1])}: "
        "give more characters"
    )


def id_of(path: Path) -> str:
    return path.name.removesuffix(SUFFIX)
