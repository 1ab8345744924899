"""Reports an e-stop that is still latched from an earlier run."""

from deploy.stack.launch import Launch
from deploy.stack.statedir import StateDir
from supervisor.estop_record import is_recorded
from wire import topics

RESET = "press r in teleop to reset it"


def latched_sentence(state: StateDir, launch: Launch) -> str | None:
    """Return a message that the robot starts with its e-stop latched and how to reset it, else None."""
    if not is_recorded(state.path, launch.bus.namespace):
        return None
    service = f"{launch.bus.namespace}/{topics.SUPERVISOR_RESET.key}"
    return (
        "the e-stop is still latched from an earlier run, and the robot does not move until it is reset: "
        f"press r in teleop, or call the service {service}"
    )
