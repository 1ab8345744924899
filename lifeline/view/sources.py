"""Opens a recording or a black box, with the configuration of its robot."""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from lifeline.incidents import incident
from lifeline.incidents.incident import IncidentError
from lifeline.recording.reader import Recorded, RecordingReader
from lifeline.view.scene import Scene
from supervisor.blackbox.file import SUFFIX
from supervisor.blackbox.reader import BlackBoxError, BlackBoxReader
from supervisor.config import SupervisorSection
from wire.topics import lidar_scan


class Source(NamedTuple):
    """The messages of a file, in order of time, and the scene that draws them."""

    name: str
    scene: Scene
    messages: Iterator[Recorded]


def scene_of(config: SupervisorSection, namespace: str) -> Scene:
    """Return the scene of a robot with this configuration."""
    topics = [lidar_scan(lidar.topic) for lidar in config.all_lidars()]
    return Scene(config.law(), topics, namespace)


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
