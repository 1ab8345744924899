"""The faults of both campaigns: draw a fault's parameters, and inject it through a port. Pure.

An injection is a generator: it begins the fault, yields the time just before, and ends the fault when it is resumed.
What must be undone even if the fault does not begin is in a `finally`.
"""

import math
from collections.abc import AsyncGenerator, Callable
from random import Random
from typing import Concatenate, ParamSpec

from faults.attacks import ATTACKS, SECOND
from faults.page import CONNECTIONS, PageFault
from faults.port import PAGE, End, Fault, Hold, Parameters, Pillar, Port
from wire import topics

TELEOP, SUPERVISOR, SIM = topics.TELEOP, topics.SUPERVISOR, topics.SIM
CUT_S = 1.5
"""A permanent cut is healed after this time, so that the next trial can begin."""
HEALED_AFTER_S = (0.3, 1.0, 3.0)
STEPS_S = (0.05, 0.15, 0.3, 1.0, 3600.0)
RATES_HZ = (1.0, 2.0, 3.0, 4.0, 5.0, 8.0, 14.0)
PAUSE_AFTER_S, PAUSE_S = 0.4, 0.6
"""Start and duration of the real lidar's pause beside a second writer."""
LOOK_S = 0.05

Draw = Callable[[Random], Fault[Port]]


def lasting(chance: Random, low_s: float, high_s: float) -> float:
    """Return a random time between the two, in whole milliseconds."""
    return round(chance.uniform(low_s, high_s), 3)


P = ParamSpec("P")


def drawn(draw: Callable[Concatenate[Random, P], Fault[Port]]) -> Callable[P, Draw]:
    """Make a function that draws a fault into one that takes its other arguments and returns the draw."""
    return lambda *args, **named: lambda chance: draw(chance, *args, **named)


# --- processes


@drawn
def kill(_: Random, *nodes: str) -> Fault[Port]:
    async def steps(port: Port) -> AsyncGenerator[float]:
        yield port.kill(*nodes)
        await port.restart(*nodes)

    return Fault(steps, any_length=True)


@drawn
def end(chance: Random, node: str, *ways: End) -> Fault[Port]:
    how = chance.choice(ways)

    async def steps(port: Port) -> AsyncGenerator[float]:
        yield port.end(node, how)
        await port.restart(node)

    return Fault(steps, {"how": how.value}, any_length=True)


@drawn
def hold(chance: Random, node: str, *ways: Hold) -> Fault[Port]:
    for_s, how = lasting(chance, 0.35, 1.2), chance.choice(ways)

    async def steps(port: Port) -> AsyncGenerator[float]:
        yield port.hold(node, how, for_s)
        port.let_go(node, how)

    return Fault(steps, {"how": how.value}, for_s, any_length=True)


# --- sensors


def _sensors(
    faults: str, lasts_s: float, pillar: Pillar = Pillar.BY_CHANCE, *, any_length: bool = False
) -> Fault[Port]:
    async def steps(port: Port) -> AsyncGenerator[float]:
        yield await port.sensors(faults)
        await port.mend_sensors()

    return Fault(steps, {"faults": faults}, lasts_s, any_length=any_length, pillar=pillar)


def spoil(faults: str) -> Draw:
    return lambda chance: _sensors(faults, lasting(chance, 0.5, 1.0), any_length=True)


def in_the_way(faults: str) -> Draw:
    """Return the draw of a fault with a pillar straight ahead: the operator re-arms, and drives at it again."""
    return lambda chance: _sensors(faults, lasting(chance, 3.0, 4.0), Pillar.AHEAD)


def blocked(chance: Random) -> Fault[Port]:
    """A sector of 20 to 120°, ahead or anywhere."""
    middle_rad = chance.choice((0.0, chance.uniform(-3.1, 3.1)))
    half_rad = math.radians(chance.uniform(10.0, 60.0))
    faults = f"blocked {middle_rad - half_rad:.2f} {middle_rad + half_rad:.2f}"
    return _sensors(faults, lasting(chance, 0.5, 1.0), any_length=True)


def slow_scans(chance: Random) -> Fault[Port]:
    return _sensors(f"rate {chance.choice(RATES_HZ):g}", lasting(chance, 0.8, 1.5), any_length=True)


def dirt(chance: Random) -> Fault[Port]:
    """1 to 20° straight ahead."""
    half_rad = math.radians(chance.uniform(0.5, 10.0))
    return in_the_way(f"blocked {-half_rad:.3f} {half_rad:.3f}")(chance)


def dropout(chance: Random) -> Fault[Port]:
    """At the rate of a fast lidar or of a slow one."""
    faults = f"dropout {chance.uniform(0.02, 0.3):.3f}; rate {chance.choice((20.0, 5.5)):g}"
    return _sensors(faults, lasting(chance, 5.0, 6.0), Pillar.AHEAD)


def short(chance: Random) -> Fault[Port]:
    """Reduce the range while the robot drives; with a lidar without any return since the start, it need not start.

    A few beams are missing as well, because scans without any return would all be equal.
    """
    return in_the_way(f"reach {chance.uniform(0.5, 1.0):.2f}; beams 0.02")(chance)


def stray(chance: Random) -> Fault[Port]:
    """Rare enough that two consecutive scans hardly ever have one."""
    return _sensors("stray 0.04", lasting(chance, 1.5, 2.0), Pillar.NONE)


# --- network


def _cut(
    node: str, lasts_s: float, *, up: bool = True, down: bool = True, any_length: bool = False
) -> Fault[Port]:
    async def steps(port: Port) -> AsyncGenerator[float]:
        yield port.cut(node, up=up, down=down)
        port.heal(node)

    return Fault(steps, lasts_s=lasts_s, any_length=any_length)


def cut(node: str, *, up: bool = True, down: bool = True) -> Draw:
    """Return the draw of a cut of the named directions; `up` leads to the hub."""
    return lambda _: _cut(node, CUT_S, up=up, down=down, any_length=True)


def heal(node: str) -> Draw:
    return lambda chance: _cut(node, chance.choice(HEALED_AFTER_S))


@drawn
def delay(chance: Random, node: str) -> Fault[Port]:
    least_s, most_s = sorted(lasting(chance, 0.05, 0.5) for _ in range(2))

    async def steps(port: Port) -> AsyncGenerator[float]:
        yield port.delay(node, least_s, most_s)
        port.heal(node)

    parameters: Parameters = {"delay_s": most_s, "least_delay_s": least_s}
    return Fault(steps, parameters, lasting(chance, 1.0, 1.5), any_length=True)


# --- wire


@drawn
def attack(chance: Random, name: str) -> Fault[Port]:
    seed, for_s = chance.randrange(1 << 31), lasting(chance, 0.5, 1.0)
    parameters = Parameters()

    async def steps(port: Port) -> AsyncGenerator[float]:
        yield port.attack(name, seed, for_s)
        parameters["sent"] = port.end_attack(name)

    return Fault(steps, parameters, for_s)


@drawn
def second_writer(chance: Random, name: str, low_s: float, high_s: float) -> Fault[Port]:
    """The real lidar pauses once, so that the second writer is alone."""
    seed, for_s = chance.randrange(1 << 31), lasting(chance, low_s, high_s)
    parameters = Parameters()

    async def steps(port: Port) -> AsyncGenerator[float]:
        try:
            at_s = port.attack(name, seed, for_s)
            await port.pause(PAUSE_AFTER_S)
            await port.sensors("silent")
            await port.pause(PAUSE_S)
            await port.mend_sensors()
            yield at_s
        finally:
            parameters["sent"] = port.end_attack(name)
            await port.mend_sensors()

    return Fault(steps, parameters, for_s, pillar=Pillar.AHEAD)


def clock_step(chance: Random) -> Fault[Port]:
    node, by_s = chance.choice((TELEOP, SIM)), chance.choice((-1, 1)) * chance.choice(STEPS_S)

    async def steps(port: Port) -> AsyncGenerator[float]:
        yield port.step_clock(node, by_s)
        port.step_clock(node, -by_s)

    return Fault(steps, {"process": node, "by_s": by_s}, lasting(chance, 0.5, 1.0))


# --- the page of a station


def frozen_picture(chance: Random) -> Fault[Port]:
    return _page(chance, PageFault(frozen=True), {})


def page_garbage(chance: Random) -> Fault[Port]:
    on, seed = chance.choice(CONNECTIONS), chance.randrange(1 << 31)
    return _page(chance, PageFault(garbage_on=on, seed=seed), {"on": on})


def _page(chance: Random, fault: PageFault, parameters: Parameters) -> Fault[Port]:
    async def steps(port: Port) -> AsyncGenerator[float]:
        yield port.set_page_fault(fault)
        port.set_page_fault(PageFault())

    return Fault(steps, parameters, lasting(chance, 0.8, 1.5))


# --- e-stop


@drawn
def estop_and_kill(chance: Random, node: str) -> Fault[Port]:
    """Press the e-stop, kill a process, then request neutral and motion without a reset."""
    pause_s = lasting(chance, 0.0, 0.3)

    async def steps(port: Port) -> AsyncGenerator[float]:
        at_s = await port.press_estop()
        await port.pause(pause_s)
        port.kill(node)
        yield at_s
        await port.restart(node)
        await port.insist()

    return Fault(steps, {"pause_s": pause_s}, LOOK_S)


DRAWS: dict[str, Draw] = {
    "teleop_sigkill": kill(TELEOP),
    "teleop_sigterm": end(TELEOP, End.TERM),
    "teleop_sigstop": hold(TELEOP, Hold.STOP),
    "teleop_blocked": hold(TELEOP, Hold.BLOCK),
    "teleop_exception": end(TELEOP, End.RAISE),
    "teleop_hang_up": end(TELEOP, End.HANG_UP),
    "teleop_end_of_input": end(TELEOP, End.INPUT),
    "teleop_gil": hold(TELEOP, Hold.GIL),
    "supervisor_sigkill": kill(SUPERVISOR),
    "supervisor_sigstop": hold(SUPERVISOR, Hold.STOP),
    "supervisor_blocked": hold(SUPERVISOR, Hold.BLOCK, Hold.GIL, Hold.DECIDED),
    "supervisor_and_teleop_sigkill": kill(SUPERVISOR, TELEOP),
    "supervisor_restart": end(SUPERVISOR, End.TERM, End.RAISE),
    "sim_sigkill": kill(SIM),
    "sim_sigstop": hold(SIM, Hold.STOP),
    "sim_blocked": hold(SIM, Hold.BLOCK, Hold.GIL),
    "sim_scan_frozen": spoil("freeze"),
    "sim_scan_nan": spoil("all_nan"),
    "sim_scan_blocked": blocked,
    "sim_scan_silent": spoil("silent"),
    "sim_scan_rate": slow_scans,
    "sim_odom_gone": spoil("no_odom"),
    "sim_scan_dirt": dirt,
    "sim_scan_dropout": dropout,
    "sim_scan_short": short,
    "sim_scan_stray": stray,
    "sim_scan_frozen_no_odom": in_the_way("freeze; no_odom"),
    "sim_scan_frozen_odom_zero": in_the_way("freeze; odom_zero"),
    "net_cut": cut(TELEOP),
    "net_cut_base": cut(SIM),
    "net_healed": heal(TELEOP),
    "net_healed_base": heal(SIM),
    "net_delayed": delay(TELEOP),
    "net_delayed_base": delay(SIM),
    "net_up_only": cut(TELEOP, up=False),
    "net_down_only": cut(TELEOP, down=False),
    "net_base_deaf": cut(SIM, up=False),
    "net_base_mute": cut(SIM, down=False),
    **{f"wire_{name}": attack(name) for name in (*ATTACKS, SECOND)},
    "wire_second_lidar_steady": second_writer("second_lidar_steady", 3.0, 4.0),
    "wire_second_lidar_flood": second_writer("second_lidar_flood", 1.5, 1.6),
    "wire_clock_step": clock_step,
    "station_sigkill": kill(TELEOP),
    "station_sigstop": hold(TELEOP, Hold.STOP),
    "station_page_sigkill": kill(PAGE),
    "station_page_sigstop": hold(PAGE, Hold.STOP),
    "station_page_frozen": frozen_picture,
    "station_page_garbage": page_garbage,
    "station_supervisor_sigkill": kill(SUPERVISOR),
    **{f"estop_{node}_sigkill": estop_and_kill(node) for node in (TELEOP, SUPERVISOR, SIM)},
}
"""The draw of each class that both campaigns can inject; the rows say which campaigns do."""
