"""The simulated robot: a MuJoCo warehouse with the same keys as a real base.

drive.py      limits and ramp of the twist, and the wheels' geometry (pure)
plant.py      the robot in its world: stepping, pose, sensors, contacts, save and restore
snapshot.py   a saved state of the plant, as a value and as bytes
scene.py      the world with a robot, from a layout or MJCF file; hall.py builds layouts; room.py checks for overlaps (pure);
              build.py the options of robot and scene (pure)
layout.py     layout files, strictly checked; layouts/ the three included ones
movers.py     people and forklifts on fixed paths (pure)
program.py    the program of `python -m sim`
service.py    the asyncio shell; messages.py and diagnostics.py its messages
pace.py       due times of the physics steps: real time, a multiple, a pause (pure)
encoders.py   odometry with drift; imu.py the inertial measurement unit (pure)
sensor_faults.py parsing of sensor faults; lidar_faults.py and odometry_faults.py apply them (pure)
lidar.py      lidar scans; lidar_geometry.py mount, angles and ranges of a lidar (pure); lidar_config.py several lidars; floorplan.py exact distances from the hull (pure except for reading the model)
mj.py         MuJoCo with types, the only file that imports it
render.py     pictures without a display; gl.py the GL context; views.py cameras; caption.py and video.py captions and files
viewer.py     MuJoCo's window; overlay.py geoms drawn around the robot; shown.py the displayed state (pure)
models/       MJCF models: two robots with the same drive train, and parts of halls
"""
