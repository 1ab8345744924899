"""The simulated robot: a MuJoCo warehouse with the same keys as a real base.

drive.py      limits and ramp of the twist, and the wheels' geometry (pure)
plant.py      the robot in its world: stepping, pose, sensors, contacts, save and restore of a snapshot
scene.py      the world with a robot, from a layout or MJCF file, checked for overlaps; hall.py builds layouts
layout.py     layout files, strictly checked; layouts/ the three included ones
movers.py     people and forklifts on fixed paths (pure)
config.py     [sim] of robot.toml; lidar_config.py a lidar's mount, angles and ranges, and [[sim.lidars]]
program.py    the program of `python -m sim`
service.py    the asyncio shell; messages.py its messages, diagnostics included
pace.py       due times of the physics steps: real time, a multiple, a pause (pure)
motion_sensors.py odometry with drift, and the inertial measurement unit (pure)
sensor_faults.py  sensor faults: their text form, and their effect on scans and odometry (pure)
lidar.py      lidar scans; floorplan.py exact distances from the hull (pure except for reading the model)
mj.py         MuJoCo with types, the only file that imports it
render.py     pictures without a display: cameras and captions; gl.py the GL context; video.py the files
viewer.py     MuJoCo's window; overlay.py the displayed state, and geoms drawn around the robot
models/       MJCF models: two robots with the same drive train, and parts of halls
"""
