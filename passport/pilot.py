"""`python -m passport.pilot`: the operator's program of a measurement, which can be killed, stopped and cut off.

It commands as teleop does: it holds the name of its source, and requests a velocity at 20 Hz and immediately when the velocity changes. Each line of its
stdin contains the forward speed [m/s] and the turn rate [rad/s]. It requests zero if no line has arrived for `SILENT_S`, and ends when its stdin ends. The first
line of its stdout is `ready`, or the reason why it cannot drive.
"""

import asyncio
import math
import signal
import sys
from contextlib import suppress

from deploy.stack.errors import DeployError
from deploy.stack.reach import reach
from passport.child import READY, die_with_parent
from teleop.holder import HeldError, Holder, about_this_process
from teleop.pilots.pilot import NEUTRAL, Velocity
from teleop.rate import Rate
from wire import topics
from wire.bus import Bus, BusError, wait_until
from wire.host.command_line import read_document, service_parser
from wire.host.config import BusSection, ConfigError, section
from wire.host.process import run_process
from wire.messages import planar_twist
from wire.roles import Role
from wire.zenoh.hub_proof import HubProof

RATE_HZ = 20.0
SILENT_S = 0.5
EXIT_REFUSED = 2


class Pilot:
    """Requests the velocity that its stdin names.

    Args:
        bus: an open bus.
        source: the name of the command source.
    """

    def __init__(self, bus: Bus, source: str) -> None:
        self._commands = bus.publisher(topics.source_cmd_vel(source))
        self._holder = Holder(bus, source, self._commands, about_this_process(source))
        self._wake = asyncio.Event()
        self._wanted, self._heard_s = NEUTRAL, -math.inf

    async def run(self, stop: asyncio.Event) -> None:
        """Command until `stop`, or until the end of stdin.

        Raises:
            HeldError: another program holds the source.
        """
        await self._holder.claim()
        print(READY, flush=True)
        loop = asyncio.get_running_loop()
        rate = Rate(1.0 / RATE_HZ, loop.time())
        reading = asyncio.ensure_future(self._read())
        try:
            while not (stop.is_set() or reading.done()):
                rate.tick(loop.time())
                is_led = loop.time() - self._heard_s < SILENT_S
                self._commands.put(planar_twist(*(self._wanted if is_led else NEUTRAL)))
                await wait_until(self._wake, rate.next_s)
                self._wake.clear()
        finally:
            reading.cancel()
            self._commands.put(planar_twist(*NEUTRAL))
            await self._holder.leave()

    async def _read(self) -> None:
        lines = asyncio.StreamReader()
        loop = asyncio.get_running_loop()
        await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(lines), sys.stdin)
        while line := await lines.readline():
            wanted, self._heard_s = velocity_in(line), loop.time()
            if wanted != self._wanted:
                self._wanted = wanted
                self._wake.set()


def velocity_in(line: bytes) -> Velocity:
    """Return the velocity in a line of stdin; neutral if the line is not two finite numbers."""
    with suppress(ValueError, TypeError):
        wanted = Velocity(*map(float, line.split()))
        if all(map(math.isfinite, wanted)):
            return wanted
    return NEUTRAL


async def _run(stop: asyncio.Event, bus_section: BusSection, source: str) -> int:
    config = bus_section.to_bus_config(Role.OPERATOR)
    try:
        bus = await reach(config, stop, HubProof(config, lambda _: None))
        if bus is not None:
            try:
                await Pilot(bus, source).run(stop)
            finally:
                await bus.close()
    except (DeployError, BusError, HeldError) as error:
        print(error, flush=True)
        return EXIT_REFUSED
    return 0


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parser = service_parser("passport.pilot")
    parser.add_argument("--source", metavar="NAME", required=True, help="name of the command source")
    parser.add_argument("parent", metavar="PID", type=int, help="the process that starts it")
    arguments = parser.parse_args()
    die_with_parent(arguments.parent)
    try:
        settings = section(read_document(arguments), "bus", BusSection)
    except ConfigError as refused:
        print(refused, flush=True)
        sys.exit(EXIT_REFUSED)
    run_process(
        "pilot", lambda stop: _run(stop, settings, arguments.source), memory_keeper=settings.memory_keeper
    )
