"""Closed-loop search over random scenes: the law drives a kinematic robot model among stationary objects.

world.py      objects as capsules, and the exact clearance of a hull
scene.py      a random scene from a seed
sensing.py    lidar model: ray casting, dirt, dropouts, noise, stray readings
base.py       models of a base
operators.py  operators that drive at objects
law.py        configuration and inputs of the law; the only file that uses their types
run.py        run one scene in closed loop
summary.py    summarize many runs
simple.py     build scenes with few objects by hand
drawing.py    describe and draw one run
worst.py      `python -m tests.scenes.worst`: search for the worst case with an optimizer
__main__.py   `python -m tests.scenes`: search many scenes, or replay one
"""
