"""The ROS 2 process: connects a ROS 2 robot and its command topics to the supervisor (docs/ros2.md).

config.py       `[ros2]` of robot.toml; imports nothing of ROS
node.py         the ROS 2 node over DDS: the only file that imports rclpy
rmw_zenoh.py    the same node over Zenoh, for a robot with rmw_zenoh, without rclpy
rmw_keys.py     the keys, tokens and hashes of rmw_zenoh (pure)
ros.py          the interface of the node, what discovery knows of an endpoint, and a report
program.py      the command line of `python -m ros2`
service.py      the asyncio shell between the node and the Zenoh session
presence.py     which programs publish on the topics of the sources, and which of them are alive
commands.py     the commands of one topic, with hold and arming on request; the robot's, with the base's own watchdog (pure)
samples.py      the messages of one topic, separated by writer (pure)
guard.py        detects the death of a publisher's process on this host
check_base.py   measures how long the base keeps its last command
reports.py      the reports on /diagnostics and /lifeline/status; mismatches in plain words (pure)
status.py       the beginning of a SafetyStatus, read from its bytes (pure)
environment.py  the environment variables of a Python with rclpy (pure)
"""
