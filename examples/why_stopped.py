"""Print each stop of the robot in words: the reasons, and what clears them. Ctrl-C quits.

python examples/why_stopped.py [ENDPOINT]
"""

import asyncio
import sys
from contextlib import suppress

from supervisor.law.stop_rules import STOP_RULES, cleared_by
from wire import topics
from wire.messages import SafetyStatus
from wire.reasons import WORDS, StopReason
from wire.zenoh.bus import DEFAULT_ENDPOINT, BusConfig, open_bus


async def main() -> None:
    bus = await open_bus(BusConfig(sys.argv[1] if len(sys.argv) > 1 else DEFAULT_ENDPOINT), "client")
    came = asyncio.Event()
    statuses = bus.subscribe(topics.STATUS, depth=100, wake=came, repeats_wake=False)
    before = ""
    try:
        while True:
            await came.wait()
            came.clear()
            for arrival in statuses.take():
                said = before if arrival.message is None else in_words(arrival.message)
                if said != before:
                    before = said
                    print(said, flush=True)
    finally:
        await bus.close()


def in_words(status: SafetyStatus) -> str:
    """Each stop reason that holds or is latched, and what clears it."""
    causes, over = status.causes_and_latched()
    holding = [told(name, over=False) for name in causes]
    return "; ".join([*holding, *(told(name, over=True) for name in over)]) or "free to move"


def told(name: str, *, over: bool) -> str:
    """One stop reason; by its name alone where this version does not know it."""
    try:
        reason = StopReason(name)
    except ValueError:
        return name
    words = WORDS[reason]
    return f"{name}: {words.over if over else words.now} (cleared by: {cleared_by(STOP_RULES[reason])})"


if __name__ == "__main__":
    with suppress(KeyboardInterrupt):
        asyncio.run(main())
