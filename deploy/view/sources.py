"""What to show: a recording or a black box, with the configuration of the robot in it."""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from deploy.inspection import incident
from deploy.inspection.incident import IncidentError
from deploy.inspection.recording import Recorded, RecordingReader
from deploy.stack.errors import DeployError
from deploy.view.scene import Scene
from supervisor.blackbox_file import SUFFIX
from supervisor.blackbox_reader import BlackBoxError, BlackBoxReader
from supervisor.config import SupervisorSection
from wire.topics import lidar_scan

RECORDING_SUFFIX = ".mcap"


class Source(NamedTuple):
    """The messages of a file, in order of time, and the scene that draws them."""

    name: str
    scene: Scene
    messages: Iterator[Recorded]


def scene_of(config: SupervisorSection, namespace: str) -> Scene:
    """Return the scene of a robot with this configuration."""
    topics = [lidar_scan(lidar.topic) for lidar in config.all_lidars()]
    return Scene(config.law(), topics, namespace)


def found(what: str, black_boxes: Path) -> Path:
    """Return the file that is meant by its path, or by the beginning of a black box's name.

    Args:
        what: a path, or an ID: the name of a black box or its beginning.
        black_boxes: the directory of the black boxes.

    Raises:
        DeployError: there is no such file, or there are several.
    """
    path = Path(what)
    if path.is_file() or what.endswith((RECORDING_SUFFIX, SUFFIX)) or "/" in what:
        return path
    files = sorted(black_boxes.glob(f"*{SUFFIX}"))
    named = [file for file in files if file.name == what + SUFFIX] or [
        file for file in files if file.name.startswith(what)
    ]
    if len(named) == 1:
        return named[0]
    if named:
        raise DeployError(f"{what!r} is the beginning of {len(named)} black boxes: give more of the name")
    raise DeployError(
        f"there is no file and no black box {what!r} in {black_boxes}: name a file, or see `lifeline status`"
    )


def read(path: Path, config: SupervisorSection, namespace: str) -> Source:
    """Open a recording or a black box; a black box brings its own configuration.

    Raises:
        DeployError: the file cannot be read, or is neither.
    """
    if not path.name.endswith(SUFFIX):
        return Source(path.name, scene_of(config, namespace), RecordingReader(path).messages())
    try:
        reader = BlackBoxReader(path)
        topics = [lidar_scan(topic) for topic in reader.lidar_topics]
        scene = Scene(reader.law, topics, namespace)
    except (BlackBoxError, ValueError) as error:
        raise IncidentError(str(error)) from error
    return Source(path.name, scene, incident.messages(path, namespace))
