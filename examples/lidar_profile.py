"""Find the profile that fits a lidar: print the share of 5 s of readings that each profile explains.

    python examples/lidar_profile.py [ENDPOINT [KEY]]

docs/how-to/lidar-profile.md says how to choose by the output.
"""

import asyncio
import sys
from collections import Counter

import numpy as np

from supervisor.law.lidar import PROFILES, LidarProfile, explain
from wire import topics
from wire.messages import LaserScan
from wire.zenoh.bus import DEFAULT_ENDPOINT, BusConfig, open_bus

LISTEN_S = 5.0


async def main(endpoint: str = DEFAULT_ENDPOINT, key: str = topics.SCAN.key) -> None:
    bus = await open_bus(BusConfig(endpoint), "client")
    try:
        arrivals = bus.subscribe(topics.lidar_scan(key), depth=1000)
        await asyncio.sleep(LISTEN_S)
        scans = [arrival.message for arrival in arrivals.take() if arrival.message is not None]
    finally:
        await bus.close()
    if not scans:
        sys.exit(f"no scan came on {key} within {LISTEN_S:g} s: name the lidar's key as the second argument")
    for name, profile in PROFILES.items():
        print(f"{name:12} {judge(scans, profile)}")


def judge(scans: list[LaserScan], profile: LidarProfile) -> str:
    """The share of the readings that the profile explains, and the three most frequent that it does not."""
    unexplained: Counter[float] = Counter()
    for scan in scans:
        readings = np.asarray(scan.ranges)
        explained = explain(readings, scan.range_min, scan.range_max, profile).explained
        unexplained.update(np.nan_to_num(readings[~explained], nan=-1.0).round(3).tolist())
    share = 1.0 - unexplained.total() / sum(len(scan.ranges) for scan in scans)
    most = ", ".join("NaN" if value < 0.0 else f"{value:g}" for value, _ in unexplained.most_common(3))
    return f"explains {share:7.2%}" + (f", but not {most}" if most else "")


if __name__ == "__main__":
    asyncio.run(main(*sys.argv[1:]))
