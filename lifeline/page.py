"""The running robot for the page of an e-stop station: what it shows, and with which command source it drives."""

import asyncio
from typing import Any

from deploy.stack.errors import DeployError
from deploy.stack.launch import ANY_BASE, Launch
from lifeline.view.ghost import stopping_of
from lifeline.view.picture import Picture
from lifeline.view.scene import scene_of
from station.messages import Fields
from supervisor.config import SupervisorSection
from supervisor.measured import MeasuredSection
from teleop.pilots.config import TeleopSection
from teleop.wheel import SourceWheel
from wire.bus import Bus, Subscription


class LivePainter:
    """Pictures of a running robot; it subscribes to its topics when the first page watches.

    Args:
        picture: keeps what is drawn.
        passport: the sentence of the robot's passport; empty: none.
        source: the command source with which pages drive.
    """

    def __init__(self, picture: Picture, passport: str, source: str) -> None:
        self._picture, self._passport, self._source = picture, passport, source
        self._bus: Bus | None = None
        self._heard: dict[str, Subscription[Any]] = {}

    def join(self, bus: Bus) -> None:
        """Use an open bus from now on."""
        self._bus = bus

    def robot(self) -> Fields:
        return {**self._picture.robot(), "passport": self._passport, "source": self._source}

    def picture(self) -> tuple[Fields, float]:
        """Return the newest picture, and when its oldest scan arrived: of each topic, only the newest message is drawn."""
        if self._bus is not None and not self._heard:
            self._heard = {name: self._bus.subscribe(topic) for name, topic in self._picture.topics.items()}
        for name, subscription in self._heard.items():
            for arrival in subscription.take_raw()[-1:]:
                self._picture.hear(name, arrival.arrival_s, arrival.payload)
        return self._picture.picture(asyncio.get_running_loop().time()), self._picture.scan_s


def painter_of(launch: Launch, passport: str) -> LivePainter | None:
    """Return what shows the robot, with the sentence of its passport (empty: none); None if its configuration is not known here."""
    if ANY_BASE in launch.nodes:
        return None
    config = launch.section("supervisor", SupervisorSection)
    measured = launch.section("measured", MeasuredSection)
    scene = scene_of(config, launch.bus.namespace)
    picture = Picture(scene, stopping_of(config, measured), config.max_linear_m_s)
    return LivePainter(picture, passport, launch.section("teleop", TeleopSection).source)


def wheel_of(launch: Launch) -> SourceWheel:
    """Return the command source with which a page drives.

    Raises:
        DeployError: the robot's configuration is not known here, or it does not have this source.
    """
    if ANY_BASE in launch.nodes:
        raise DeployError("--drive needs the robot's configuration: name it with --config")
    config = launch.section("supervisor", SupervisorSection)
    source = launch.section("teleop", TeleopSection).source
    if source not in (one.name for one in config.sources):
        raise DeployError(f"--drive: [teleop] source = {source!r} is not in [supervisor] sources: add it")
    return SourceWheel(source, (config.max_linear_m_s, config.max_angular_rad_s))
