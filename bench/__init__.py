"""Benchmarks: what the law, the supervisor, teleop and the sim take of time and memory. They are no tests and never fail.

scenery.py     the scans, odometry and commands that all of them use
law.py         step(): time and memory, against plain numpy on the same arrays
process.py     the real supervisor process over real Zenoh: CPU, memory, cmd_vel's rate and gaps
heartbeat.py   the real teleop in terminal.py's terminal: how late its heartbeat is while it draws
relay.py       what stands in the supervisor's place there: the same traffic, and no law
feed.py        what these two are fed with, and the supervisor that they speak with
sim.py         the simulated robot, unpaced, beside MuJoCo alone
report.py      the results as a terminal's table, as markdown, as JSON lines
__main__.py    python -m bench

estop_kill.py  press the e-stop, kill the supervisor, and count the runs that stay latched
black_box.py   what the black box costs
"""
