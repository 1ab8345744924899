"""The robot, simulated: a MuJoCo warehouse behind the keys that a real base would serve.

watchdog.py   the base's own last line of defence (pure: time is an argument)
drive.py      limits and ramp of the twist, and the wheels' geometry (pure)
plant.py      the robot in its warehouse: step it, ask where it is, what it sees, what it touches
lidar.py      the beams; floorplan.py the exact distances, for tests and demos
mj.py         MuJoCo with types, the one file that imports it
render.py     a picture of it all
models/       the worlds in MJCF: warehouse.xml includes robot.xml and attaches rack.xml
"""
