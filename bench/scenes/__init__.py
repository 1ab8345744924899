"""Closed-loop search over random scenes: the law drives a robot in plain kinematics among stationary objects.

world.py      objects as capsules, and the exact clearance of a hull
scene.py      a random scene from a seed
sensing.py    what a lidar reads there: ray casting, dirt, dropouts, noise, stray readings
base.py       how a base follows its command
operators.py  an operator who drives at objects
law.py        the only file that knows the law's types
run.py        one scene in closed loop
summary.py    the figures of many runs
drawing.py    one run as a picture
"""
