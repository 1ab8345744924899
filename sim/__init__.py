"""The robot, simulated: a MuJoCo warehouse behind the keys that a real base would serve.

watchdog.py   the base's own last line of defence (pure: time is an argument)
drive.py      limits and ramp of the twist, and the wheels' geometry (pure)
plant.py      the robot in its world: step it, ask where it is, what it sees, what it touches; save it and go back
snapshot.py   a moment of it, as a value and as bytes
scene.py      the world: a layout or an MJCF file, a robot in it; build.py what may differ between two robots (pure);
              hall.py builds a layout; room.py what has room (pure)
layout.py     layout files, read strictly; layouts/ the three that come along
movers.py     people and forklifts on their ways (pure)
program.py    the program of `python -m sim`
service.py    the asyncio shell; messages.py and diagnostics.py what it says
pace.py       which step is due when: real time, a multiple, a pause (pure)
encoders.py   odometry that drifts; imu.py the inertial unit (pure)
sensor_faults.py what can be wrong; lidar_faults.py and odometry_faults.py do it (pure)
lidar.py      the beams; lidar_geometry.py where a lidar is and what it measures (pure); lidar_config.py several of them; floorplan.py the exact distances from the hull (pure but for reading the model)
mj.py         MuJoCo with types, the one file that imports it
render.py     pictures without a screen; gl.py what draws them; views.py from where; caption.py and video.py words and files
viewer.py     MuJoCo's window; overlay.py what is drawn around the robot; shown.py what is known of it (pure)
models/       in MJCF: two robots on one drive train, and what halls are made of
"""
