"""One round: all conditions at once, each with several flows, in one pair of namespaces."""

import json
import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict, astuple, dataclass
from pathlib import Path
from typing import Any

from bench.link.flows import PORT
from bench.link.namespaces import Pair, inside, pair
from bench.link.results import MAX_CONDITIONS, Condition, Measured, Round
from bench.link.stops import disturbed, length_s, outside
from bench.rig.load import busy_percent, machine
from bench.rig.program import program
from deploy.keys.commands import init, issue
from deploy.keys.register import Request
from deploy.stack.provenance import now
from wire import tls
from wire.roles import Role

FLOWS = "bench.link.flows"
START_LIMIT_S, FRESH_LIMIT_S, END_LIMIT_S = 90.0, 120.0, 60.0
LIFETIME_S = 86_400.0
"""Of the certificates."""
SETTLE_S = 1.0
"""Between the begin of the losses and the begin of the count."""


@dataclass(frozen=True)
class Plan:
    """What one round measures."""

    conditions: Sequence[Condition]
    flows: int
    """Of each condition."""
    seconds: float
    seed: int
    together: int = 1
    """How many flows share a process."""


def measure(plan: Plan) -> tuple[Round, list[Measured]]:
    """Measure one round.

    Raises:
        RuntimeError: a program of the bench failed, or no flow was fresh in time.
        DeployError: no namespaces can be made here.
    """
    if len(plan.conditions) > MAX_CONDITIONS:
        raise RuntimeError(f"a round can have at most {MAX_CONDITIONS} conditions")
    numbered = dict(enumerate(plan.conditions, 1))
    # Each flow has a hub of its own.
    hubs = [
        {
            "endpoint": tls.zenoh_endpoint(f"{one.link}/{Pair.b_address(number)}:{port}"),
            "lease_s": one.lease_s,
        }
        for number, one in numbered.items()
        for port in range(PORT, PORT + plan.flows)
    ]
    paths = {number: astuple(one.path) for number, one in numbered.items()}
    with tempfile.TemporaryDirectory() as made, pair(numbered) as spaces:
        folder = Path(made)
        a_keys, b_keys = _bundles(folder / "keys", tuple(map(Pair.b_address, numbered)))
        fds = (spaces.a_fd, spaces.b_fd)
        relayed_plan = json.dumps({"paths": paths, "seed": plan.seed})
        with (
            program("bench.link.relay", (), [*map(str, fds), relayed_plan], fds) as relay,
            program(FLOWS, inside(spaces.b), ["receiver"], name="receiver") as receiver,
            program(FLOWS, inside(spaces.a), ["sender"], name="sender") as sender,
        ):
            receiver.tell(json.dumps({"keys": b_keys, "flows": hubs, "together": plan.together}))
            relay.expect("ready", START_LIMIT_S)
            receiver.expect("ready", START_LIMIT_S)
            sender.tell(json.dumps({"keys": a_keys, "flows": hubs, "together": plan.together}))
            sender.expect("ready", START_LIMIT_S)
            word, *silent = receiver.line(FRESH_LIMIT_S).split()
            if word != "fresh":
                names = sorted({str(plan.conditions[int(flow) // plan.flows]) for flow in silent})
                raise RuntimeError(f"no fresh command before the losses began: {', '.join(names)}")
            relay.tell("lose")
            relay.expect("done", START_LIMIT_S)
            time.sleep(SETTLE_S)
            before = machine()
            receiver.tell("begin")
            time.sleep(plan.seconds)
            receiver.tell("end")
            heard = json.loads(receiver.line(END_LIMIT_S))
            busy = busy_percent(before, machine())
            sender.tell("end")
            sent = json.loads(sender.line(END_LIMIT_S))
            relay.tell("end")
            relayed = json.loads(relay.line(END_LIMIT_S))
    return _result(plan, heard, sent, relayed, busy)


def _bundles(folder: Path, hosts: tuple[str, ...]) -> tuple[str, str]:
    """Issue certificates for this run; return the bundles of the operators and of their hubs."""
    init(folder, replace=False)
    operator = Request("operator", Role.OPERATOR, None, None)
    hub = Request("hub", Role.SUPERVISOR, None, hosts)
    return issue(folder, operator, LIFETIME_S)["bundle"], issue(folder, hub, LIFETIME_S)["bundle"]


def _result(
    plan: Plan, heard: dict[str, Any], sent: dict[str, Any], relayed: dict[str, Any], busy: float
) -> tuple[Round, list[Measured]]:
    window: tuple[float, float] = tuple(heard["window"])
    lates = {"router": relayed["late"], "sender": sent["late"], "receiver": heard["late"]}
    moments = [(due_s, late_s) for late in lates.values() for due_s, late_s in late["moments"]]
    spans = disturbed(moments, window)
    quiet_s = window[1] - window[0] - length_s(spans)
    found: list[Measured] = []
    for number, condition in enumerate(plan.conditions):
        flows = heard["flows"][number * plan.flows :][: plan.flows]
        stops = sum(len(one["stops_s"]) for one in flows)
        kept = sum(len(outside(one["stops_s"], spans)) for one in flows)
        found.append(
            Measured(
                **asdict(condition),
                flows=plan.flows,
                flow_s=plan.flows * quiet_s,
                stops=kept,
                disturbed_stops=stops - kept,
                worst_age_s=max(one["worst_age_s"] for one in flows),
                arrived=sum(one["arrived"] for one in flows),
                refused=sum(one["refused"] for one in flows),
                links_lost=sum(one["lost"] for one in flows),
            )
        )
    counts = relayed["counts"]
    made = Round(
        date=now(),
        seconds=window[1] - window[0],
        seed=plan.seed,
        flows=len(plan.conditions) * plan.flows,
        busy_percent=busy,
        disturbed_s=length_s(spans),
        packets=counts["passed"] + counts["lost"],
        lost=counts["lost"],
        **{
            f"{part}_late_{name}_ms": 1000 * late[f"{name}_s"]
            for part, late in lates.items()
            for name in ("p99", "max")
        },
    )
    return made, found
