"""Print each stop of the robot in words: the reasons, and what clears them. Ctrl-C quits.

python examples/why_stopped.py [ENDPOINT]
"""

import asyncio
import sys
from contextlib import suppress

from supervisor.stop_rules import STOP_RULES, cleared_by
from wire import topics
from wire.reasons import WORDS, StopReason
from wire.zenoh_bus import DEFAULT_ENDPOINT, BusConfig, open_bus


async def main() -> None:
    bus = await open_bus(BusConfig(sys.argv[1] if len(sys.argv) > 1 else DEFAULT_ENDPOINT), "client")
    came = asyncio.Event()
    statuses = bus.subscribe(topics.STATUS, depth=100, wake=came, repeats_wake=False)
    before: list[str] = []
    try:
        while True:
            await came.wait()
            came.clear()
            for arrival in statuses.take():
                if arrival.message is not None and arrival.message.reasons != before:
                    before = arrival.message.reasons
                    print("; ".join(map(in_words, before)) or "free to move", flush=True)
    finally:
        await bus.close()


def in_words(name: str) -> str:
    """A stop reason and what clears it; the name alone if this version does not know it."""
    with suppress(ValueError):
        reason = StopReason(name)
        return f"{name}: {WORDS[reason].over} (cleared by: {cleared_by(STOP_RULES[reason])})"
    return name


if __name__ == "__main__":
    with suppress(KeyboardInterrupt):
        asyncio.run(main())
