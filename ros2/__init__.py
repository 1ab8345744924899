"""The ROS 2 process: connects a ROS 2 robot and its command topics to the supervisor (docs/ros2.md).

config.py       `[ros2]` of robot.toml; imports nothing of ROS
cdr.py          where the velocities, times and frames are in a CDR message (pure)
"""
