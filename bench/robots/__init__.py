"""Measures how many robots one machine can supervise: `python -m bench.robots`; bench/fleet.py measures them behind a router.

* feeder.py: one process that plays the sensors, operators and bases of all robots, and records what their supervisors send
* holders.py: operators that are killed while they drive, each in a process of its own
* run.py: the measurement with one number of robots
* results.py: gaps, stops and their reasons; the stored measurements, their table and targets (pure)

Each robot has its own supervisor process and endpoint, as if it were alone. The rates are those of a real robot:
scans at 20 Hz, odometry at 50 Hz, commands at 20 Hz. The bench's own cost is measured and reported beside the results.
"""
