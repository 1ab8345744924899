"""Records which samples a link delivers, and when: `python -m tests.system.transits ENDPOINT KEYS KEY…`.

Prints `listening`. The first line of the input begins the record; the second ends it, and the program prints a line of JSON.
"""

import asyncio
import json
import sys
from dataclasses import asdict, dataclass
from pathlib import Path

from wire.bus import Inbox, RawArrival
from wire.bus_config import BusConfig
from wire.stamp import Stamp, parse_stamp
from wire.zenoh.connect import open_session
from wire.zenoh.session import ZenohSession

DEPTH = 20_000


@dataclass(frozen=True)
class Transit:
    """What has arrived of one topic."""

    arrived: int
    lost: int
    """Number of missing sequence numbers."""
    late_s: float
    """Largest transit time above the smallest."""
    bytes: int
    """Size of the largest payload."""


def transit(arrivals: list[RawArrival]) -> Transit:
    """Compare the stamps of one run of a publisher with the arrival times."""
    stamps = [_stamp(one) for one in arrivals]
    numbers = [stamp.sequence for stamp in stamps]
    times_s = [
        one.arrival_s - stamp.source_time_ns * 1e-9 for one, stamp in zip(arrivals, stamps, strict=True)
    ]
    return Transit(
        len(numbers),
        max(numbers) - min(numbers) + 1 - len(set(numbers)),
        max(times_s) - min(times_s),
        max(len(one.payload) for one in arrivals),
    )


def _stamp(arrival: RawArrival) -> Stamp:
    stamp = parse_stamp(arrival.attachment)
    assert stamp is not None
    return stamp


def listen(session: ZenohSession, key: str) -> Inbox[RawArrival]:
    """Return an inbox for all samples on a key of the robot."""
    inbox: Inbox[RawArrival] = Inbox(DEPTH, None)
    session.subscribe_raw(
        key, lambda payload, stamp, arrival_s: inbox.push(RawArrival(payload, stamp, arrival_s))
    )
    return inbox


async def main(endpoint: str, keys: str, *topics: str) -> None:
    config = BusConfig(endpoint, keys=Path(keys) if keys else None)
    session = ZenohSession(await open_session(config, "client"), config.namespace)
    inboxes = {topic: listen(session, topic) for topic in topics}
    print("listening", flush=True)
    await asyncio.to_thread(sys.stdin.readline)
    for inbox in inboxes.values():
        inbox.take()
    await asyncio.to_thread(sys.stdin.readline)
    print(json.dumps({topic: asdict(transit(inbox.take())) for topic, inbox in inboxes.items()}), flush=True)
    await session.close()


if __name__ == "__main__":
    asyncio.run(main(*sys.argv[1:]))
