"""The simulated robot: a MuJoCo warehouse with the same keys as a real base.

Start in `service.py`, the asyncio shell, and `plant.py`, the robot in its world. Only `mj.py` imports MuJoCo.
"""
