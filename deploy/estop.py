"""What a person needs to know of an e-stop that outlived the last run."""

from deploy.stack.launch import Launch
from deploy.stack.statedir import StateDir
from supervisor.estop_files import is_recorded
from wire import topics

RESET = "press r in teleop to reset it"


def latched_sentence(state: StateDir, launch: Launch) -> str | None:
    """That the robot starts with the e-stop latched, and how to reset it; None where it does not."""
    if not is_recorded(state.path, launch.bus.namespace):
        return None
    service = f"{launch.bus.namespace}/{topics.SUPERVISOR_RESET.key}"
    return (
        "the e-stop is latched since an earlier run, and the robot does not move until it is reset: "
        f"press r in teleop, or call the service {service}"
    )
