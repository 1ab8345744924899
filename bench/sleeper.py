"""Reference process that only sleeps and wakes: `python -m bench.sleeper HZ`, until it is killed."""

import asyncio
import sys

from bench.rig.feed import at_rate


def main() -> None:
    asyncio.run(at_rate(float(sys.argv[1]), lambda: None))


if __name__ == "__main__":
    main()
