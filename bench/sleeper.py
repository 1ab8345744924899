"""Reference process that only sleeps and wakes: `python -m bench.sleeper HZ`, until it is killed."""

import argparse
import asyncio

from bench.rig.feed import at_rate
from bench.rig.options import positive


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m bench.sleeper", description="Only sleep and wake, as a reference."
    )
    parser.add_argument("hz", type=positive, help="number of times a second")
    asyncio.run(at_rate(parser.parse_args().hz, lambda: None))


if __name__ == "__main__":
    main()
