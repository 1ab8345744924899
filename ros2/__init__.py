"""The ROS 2 process: connects a ROS 2 robot and its command topics to the supervisor (docs/ros2.md).

Start in `service.py`, the asyncio shell between the ROS node and the Zenoh session. `inputs.py` passes sensors and the
e-stop on. The interface of the node is in `ros.py`. `node.py` implements it over DDS and is the only file that imports
rclpy; `rmw_zenoh.py` implements it over Zenoh. `header_age.py` judges the clocks of sources, `base_clock.py` that of the base.
"""
