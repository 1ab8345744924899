"""The robot's host of test_two_hosts.py: `python -m tests.system.two_hosts SCENARIO` inside its network namespace.

Supervisor, simulated base and observer run here; the operator's teleop runs in the other namespace, which the relay connects. Prints
what it has measured as a line of JSON; an assertion that fails ends it with exit code 1.

    cut       cut the link of the driving operator: the robot stops, and stays stopped until the returned operator sends neutral
    viewers   let the links of viewers die: the operator's commands still arrive
    lossy     lose packets while the operator drives: which samples arrive, and how late
"""

import argparse
import asyncio
import itertools
import json
import os
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path as File
from typing import Any

from bench.link.namespaces import Pair, inside
from bench.link.relay import Path
from bench.rig.program import Program, program
from deploy.keys.commands import init, issue
from deploy.keys.register import Request
from tests.system.harness import PATIENCE_S, VIEWER, Robot, is_zero
from tests.system.transits import listen, transit
from wire import topics
from wire.messages import SafetyStatus
from wire.roles import Role

OPERATORS, VIEWERS = 1, 2
"""Paths in the relay."""
PORT = 7447
TIMEOUT_S, TICK_S = 0.2, 0.02
MACHINE_S = 0.2
"""What a loaded machine may add; the measured time is printed."""
WATCH_S = 1.0
DAY_S = 86400.0
DELAY_S = 0.01
LINGER_S = 10.0
"""Time for which Zenoh waits when it closes a TCP link that does not answer."""
NUMBER_OF_VIEWERS = 8
LOSS = 0.05
LOSSY_S = 20.0
HEARD_BY_OPERATOR = (topics.CMD_VEL, topics.STATUS, topics.ODOM, topics.SCAN)


async def drive_and_cut(robot: Robot, relay: Program) -> dict[str, float]:
    """Return the times from the cut of the link to zero and to standstill [s]."""
    assert robot.bus is not None
    intents = robot.bus.subscribe(topics.source_cmd_vel(topics.TELEOP), depth=1)
    await robot.drive()
    cut_s = asyncio.get_running_loop().time()
    _tell(relay, "cut")
    to_zero_s = await robot.zero_after(cut_s)
    to_rest_s, _ = await robot.standstill_after(cut_s)
    assert to_zero_s <= TIMEOUT_S + TICK_S + MACHINE_S, f"zero only {to_zero_s:.3f} s after the cut"
    lost = {"COMMAND_TIMEOUT", "SOURCE_LOST"}
    await robot.until(lambda: not lost.isdisjoint(robot.status.reasons), "the loss of the operator")
    await robot.never(lambda: abs(robot.speed_m_s) > 0.01, "it moved while the link was cut", WATCH_S)

    intents.take()
    _tell(relay, "mend")
    mended_s = asyncio.get_running_loop().time()
    moving: list[bool] = []

    def asks() -> bool:
        moving.extend(one.message is not None and not is_zero(one.message) for one in intents.take())
        return any(moving)

    await robot.until(asks, "the returned operator still asks for motion")
    await robot.never(lambda: abs(robot.speed_m_s) > 0.01, "it moved without neutral", WATCH_S)
    assert robot.status.mode == SafetyStatus.STOPPED, robot.picture()
    assert all(is_zero(twist) for at_s, twist in robot.outputs if at_s > cut_s + to_zero_s)
    await robot.drive()
    return {"to_zero_s": to_zero_s, "to_rest_s": to_rest_s, "back_s": robot.outputs[-1][0] - mended_s}


def _tell(relay: Program, command: str) -> None:
    relay.tell(command)
    relay.expect("done", PATIENCE_S)


async def viewers_die(robot: Robot, relay: Program, operator: str) -> dict[str, float]:
    """Return the longest gap in the operator's commands after the viewers' links died [s]."""
    assert robot.bus is not None
    address = f"tcp/{Pair.b_address(VIEWERS)}:{PORT}"
    viewers = subprocess.Popen(
        [*inside(operator), sys.executable, "-m", "tests.system.viewers", address, str(NUMBER_OF_VIEWERS)],
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert viewers.stdout is not None
        assert viewers.stdout.readline() == "watching\n"
        intents = robot.bus.subscribe(topics.source_cmd_vel(topics.TELEOP), depth=1000)
        await robot.until(lambda: robot.status.owner == topics.TELEOP, "teleop's heartbeat")
        intents.take()
        begin_s = asyncio.get_running_loop().time()
        _tell(relay, "lose")
        await asyncio.sleep(LINGER_S)  # it is the duration of what is measured
        times_s = [begin_s, *(one.arrival_s for one in intents.take()), asyncio.get_running_loop().time()]
        return {"longest_gap_s": max(later - earlier for earlier, later in itertools.pairwise(times_s))}
    finally:
        viewers.kill()
        viewers.communicate()


async def drive_over_losses(robot: Robot, relay: Program, operator: str) -> dict[str, dict[str, float]]:
    """Return what has arrived of each topic over the lossy link, by key."""
    assert robot.bus is not None
    intents = listen(robot.bus, topics.source_cmd_vel(topics.TELEOP).key)
    await robot.until(lambda: robot.status.owner == topics.TELEOP, "teleop's heartbeat")
    keys = str(robot.keys.get(topics.SIM, ""))
    words = ["tests.system.transits", robot.endpoint, keys, *(topic.key for topic in HEARD_BY_OPERATOR)]
    with program(words[0], inside(operator), words[1:]) as listener:
        listener.expect("listening", PATIENCE_S)
        _tell(relay, "lose")
        listener.tell("begin")
        intents.take()
        await robot.drive()
        await asyncio.sleep(LOSSY_S)  # it is the duration of what is measured
        listener.tell("end")
        heard = asdict(transit(intents.take()))
        return {topics.source_cmd_vel(topics.TELEOP).key: heard} | json.loads(listener.line(PATIENCE_S))


def bundles(directory: File, host: str) -> dict[str, File]:
    """Issue a certificate for each participant; return the bundles by node."""
    keys = directory / "keys"
    init(keys, replace=False)
    roles = {
        topics.SUPERVISOR: Role.SUPERVISOR,
        topics.SIM: Role.BASE,
        topics.TELEOP: Role.OPERATOR,
        VIEWER: Role.VIEWER,
    }
    return {
        node: File(
            issue(keys, Request(node, role, None, (host,) if role is Role.SUPERVISOR else None), DAY_S)[
                "bundle"
            ]
        )
        for node, role in roles.items()
    }


async def run(arguments: argparse.Namespace, relay: Program) -> dict[str, Any]:
    robot = Robot(f"{arguments.protocol}/{Pair.b_address(OPERATORS)}:{PORT}", arguments.logs)
    if arguments.protocol != "tcp":
        robot.keys = bundles(arguments.logs, Pair.b_address(OPERATORS))
    try:
        # Without certificates, another host takes part only if the configuration permits it.
        config = arguments.logs / "supervisor.toml"
        config.write_text('[bus]\nwithout_certificate = "participant"\n')
        listen = f"{arguments.protocol}/0.0.0.0:{PORT}"
        robot.start(topics.SUPERVISOR, "--config", str(config), "--endpoint", listen)
        robot.start(topics.SIM)
        await robot.observe()
        # A delayed teleop would become neutral; the one whose link is cut must continue to request motion.
        module = "tests.system.patient_teleop" if arguments.scenario == "cut" else topics.TELEOP
        keys = robot.keys_of(topics.TELEOP)
        robot.start_teleop(*keys, module=module, before=inside(arguments.operator))
        if arguments.scenario == "viewers":
            return await viewers_die(robot, relay, arguments.operator)
        if arguments.scenario == "lossy":
            return await drive_over_losses(robot, relay, arguments.operator)
        return await drive_and_cut(robot, relay)
    finally:
        await robot.close()


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.system.two_hosts", description=__doc__)
    parser.add_argument("scenario", choices=("cut", "viewers", "lossy"))
    parser.add_argument("operator", help="name of the operator's namespace")
    parser.add_argument("fds", type=int, nargs=2, help="file descriptors of the two TUN devices")
    parser.add_argument("--protocol", choices=("tcp", "tls", "quic"), required=True)
    parser.add_argument("--logs", type=File, required=True)
    arguments = parser.parse_args()
    paths = {
        OPERATORS: Path(LOSS if arguments.scenario == "lossy" else 0.0, DELAY_S, 0.0),
        VIEWERS: Path(1.0, DELAY_S, 0.0),
    }
    plan = {
        "paths": {number: (one.loss, one.delay_s, one.jitter_s) for number, one in paths.items()},
        "seed": 1,
    }
    words = [*map(str, arguments.fds), json.dumps(plan)]
    with program("bench.link.relay", (), words, arguments.fds) as relay:
        relay.expect("ready", PATIENCE_S)
        print(json.dumps(asyncio.run(run(arguments, relay))), flush=True)
    os._exit(0)  # Zenoh may crash or hang at the interpreter's end


if __name__ == "__main__":
    main()
