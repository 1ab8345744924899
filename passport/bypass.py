"""`python -m passport.bypass`: a hub in place of the supervisor that judges nothing, to measure the robot without Lifeline.

It passes the commands of one source to the base as they arrive, and never repeats one. A source that requests motion becomes this source. Only an e-stop
stops the robot: it is latched and recorded as by the supervisor, and zero is sent until its reset. The first line of its stdout is `ready`, or the reason why
it cannot run; it sends zero and ends when its stdin ends.
"""

import asyncio
import math
import sys
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from passport.child import READY, die_with_parent, stop_with_stdin
from supervisor.config import SupervisorSection
from supervisor.estop_record import EstopRecord, Record, RecordFiles
from supervisor.messages import planar
from teleop.path.permit import HEARD_S
from wire import topics
from wire.bus import Bus, BusError, wait_until
from wire.host.command_line import read_document, service_parser
from wire.host.config import BusSection, ConfigError, Sections, read_sections
from wire.host.process import run_process
from wire.messages import SafetyStatus, SourceStatus, TriggerResponse, Twist, header, zero_twist
from wire.reasons import StopReason
from wire.zenoh.bus import open_bus

DEPTH = 32
PERIOD_S = 0.05
"""Period of the status, and of zero while the e-stop is latched."""


class Valve:
    """Passes the commands of the source that moves the robot, unless an e-stop is latched. Pure but for the record."""

    def __init__(self, sources: Iterable[str], record: Record) -> None:
        self._heard: dict[str, tuple[bool, float]] = dict.fromkeys(sources, (True, -math.inf))
        """Whether the newest command of a source was zero, and when it arrived [s]."""
        self._owner = ""
        self._record = record
        self.is_latched = record.latched_at_start

    def passes(self, source: str, twist: Twist, arrival_s: float) -> bool:
        """Hear a command; return whether it goes to the base."""
        velocity = planar(twist)
        if velocity is None or not all(map(math.isfinite, velocity)):
            return False
        is_zero = not any(velocity)
        self._heard[source] = is_zero, arrival_s
        if not is_zero:
            self._owner = source
        return source == self._owner and not self.is_latched

    def press(self) -> None:
        """Latch the e-stop."""
        self.is_latched = True
        self._record.keep(latched=True)

    def reset(self, now_s: float) -> TriggerResponse:
        """Release the e-stop, unless a source requests motion."""
        moving = [name for name in self._heard if self._moves(name, now_s)]
        if moving:
            return TriggerResponse(success=False, message=f"{' and '.join(moving)} requests motion")
        self.is_latched = False
        self._record.keep(latched=False)
        return TriggerResponse(success=True, message="the e-stop is reset")

    def _moves(self, source: str, now_s: float) -> bool:
        is_zero, arrival_s = self._heard[source]
        return not is_zero and now_s - arrival_s <= HEARD_S

    def status(self, now_s: float) -> SafetyStatus:
        """Return what a source needs to know before it drives."""
        mode = (
            SafetyStatus.DRIVING
            if any(self._moves(name, now_s) for name in self._heard)
            else SafetyStatus.READY
        )
        causes = [StopReason.ESTOP.value] if self.is_latched else []
        sources = [
            _source_status(name, now_s - arrival_s, is_zero=is_zero)
            for name, (is_zero, arrival_s) in self._heard.items()
        ]
        return SafetyStatus(
            header("base_link"),
            mode=SafetyStatus.STOPPED if self.is_latched else mode,
            owner=self._owner,
            reasons=causes,
            causes=causes,
            sources=sources,
        )


def _source_status(name: str, age_s: float, *, is_zero: bool) -> SourceStatus:
    return SourceStatus(
        name,
        priority=0,
        liveliness=SourceStatus.UNKNOWN,
        armed=True,
        neutral=is_zero,
        stamped=True,
        age_s=age_s,
        reasons=[],
        accepted=0,
        refused_late=0,
        refused_sequence=0,
        refused_epoch=0,
        refused_invalid=0,
    )


async def pass_on(bus: Bus, sources: Iterable[str], valve: Valve, stop: asyncio.Event) -> None:
    """Pass commands to the base until `stop`, then send zero."""
    wake = asyncio.Event()
    loop = asyncio.get_running_loop()
    commands = {name: bus.subscribe(topics.source_cmd_vel(name), depth=DEPTH, wake=wake) for name in sources}
    estops = bus.subscribe(topics.ESTOP, depth=DEPTH, wake=wake)
    cmd_vel, status = bus.publisher(topics.CMD_VEL), bus.publisher(topics.STATUS)

    async def reset(_: str) -> TriggerResponse:
        return valve.reset(loop.time())

    bus.serve(topics.SUPERVISOR_RESET, reset)
    tokens = [bus.declare_alive(topics.SUPERVISOR, epoch) for epoch in (b"", bus.run_id)]
    print(READY, flush=True)
    next_s, overflowed = loop.time(), 0
    try:
        while not stop.is_set():
            await wait_until(wake, next_s)
            wake.clear()
            presses = [one for one in estops.take() if one.message is None or one.message.data]
            if presses or estops.overflowed > overflowed:  # a flood may hide a press
                overflowed = estops.overflowed
                valve.press()
                cmd_vel.put(zero_twist())
            for name, subscription in commands.items():
                for one in subscription.take():
                    if one.message is not None and valve.passes(name, one.message, one.arrival_s):
                        cmd_vel.put(one.message, one.arrival_s)
            if (now_s := loop.time()) >= next_s:
                next_s = now_s + PERIOD_S
                status.put(valve.status(now_s))
                if valve.is_latched:
                    cmd_vel.put(zero_twist())
    finally:
        cmd_vel.put(zero_twist())
        for token in tokens:
            token.withdraw()


async def _run(stop: asyncio.Event, sections: Sections, directory: Path, sources: list[str]) -> int:
    bus_section = sections[BusSection]
    contract = sections[SupervisorSection].contract(bus_section.more_keys)
    stop_with_stdin(stop)
    try:
        bus = await open_bus(replace(bus_section.to_bus_config(), contract=contract), "hub")
    except BusError as error:
        print(error, flush=True)
        return 1
    try:
        record = await asyncio.to_thread(EstopRecord, RecordFiles(directory, bus_section.namespace))
        await pass_on(bus, sources, Valve(sources, record), stop)
        record.close()
    finally:
        await bus.close()
    return 0


def _main() -> None:
    parser = service_parser("passport.bypass")
    parser.add_argument(
        "--state-dir", metavar="DIR", type=Path, required=True, help="directory of the e-stop record"
    )
    parser.add_argument(
        "--source", metavar="NAME", action="append", required=True, help="a command source; repeat it"
    )
    parser.add_argument("parent", metavar="PID", type=int, help="the process that starts it")
    arguments = parser.parse_args()
    die_with_parent(arguments.parent)
    try:
        sections = read_sections(
            read_document(arguments), {"bus": BusSection, "supervisor": SupervisorSection}
        )
    except ConfigError as refused:
        print(refused, flush=True)
        sys.exit(1)
    run_process("bypass", lambda stop: _run(stop, sections, arguments.state_dir, arguments.source))


if __name__ == "__main__":
    _main()
