"""All classes of faults for real processes, by name, and pairs of them."""

from random import Random

from faults.classes import CLASSES, FaultClass, Group
from faults.real.injectors import estop, machine, network, processes, sensors, wire
from faults.real.injectors.injection import Injection, Plan
from faults.real.rig import cable
from faults.real.rig.stage import Stage

PLANS: dict[str, Plan] = {
    **processes.PLANS,
    **sensors.PLANS,
    **network.PLANS,
    **wire.PLANS,
    **estop.PLANS,
    **machine.PLANS,
}
PAIR = "pair"
NOT_IN_PAIRS = frozenset({Group.SUPERVISORD, Group.MACHINE, Group.PAIR})
"""Each of these affects the whole stage."""
ALONE = frozenset({"net_unplugged", *(one.name for one in CLASSES if one.by_itself)})
ONE_ATTACKER = "wire_"
ONE_SENSOR = "sim_scan_"


def real_classes() -> tuple[FaultClass, ...]:
    """Return the classes of the real campaign, including pairs."""
    return tuple(one for one in CLASSES if one.real)


def draw_pair(chance: Random) -> tuple[str, str]:
    """Draw two classes that can be in force at the same time."""
    names = [one.name for one in real_classes() if one.group not in NOT_IN_PAIRS and one.name not in ALONE]
    while True:
        first, second = chance.sample(names, 2)
        if not any(
            first.startswith(kind) and second.startswith(kind) for kind in (ONE_ATTACKER, ONE_SENSOR, "net_")
        ):
            return first, second


def plan(name: str, chance: Random) -> Injection:
    return PLANS[name](chance)


def why_not(name: str, stage: Stage) -> str | None:
    """Return why this fault cannot be injected on this machine, in one sentence; None if it can."""
    if name == "net_unplugged":
        return cable.why_not()
    if name == "machine_disk" and not stage.has_disk:
        return "filling the state directory needs the right to mount a small disk there (root)"
    return None
