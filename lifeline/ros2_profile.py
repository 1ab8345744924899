"""`lifeline ros2 profile`: reads the Fast DDS profile with a short lease from the package `ros2`."""

from importlib.resources import files

from wire import topics

NAME = "fastdds_short_lease.xml"


def profile() -> str:
    """Return the profile as XML."""
    return (files(topics.ROS2) / NAME).read_text(encoding="utf-8")
