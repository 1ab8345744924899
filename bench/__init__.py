"""Benchmarks: how much time and memory the supervisor takes. They are no tests and never fail.

scenery.py     the scans, odometry and commands that all of them use
law.py         step(): time and memory, against plain numpy on the same arrays
process.py     the real supervisor process over real Zenoh: CPU, memory, cmd_vel's rate and gaps
sim.py         the simulated robot, unpaced, beside MuJoCo alone
report.py      the results as a terminal's table, as markdown, as JSON lines
__main__.py    python -m bench
"""
