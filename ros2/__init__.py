"""The ROS 2 process: connects a ROS 2 robot and its command topics to the supervisor (docs/ros2.md).

Start in `service.py`, the asyncio shell between the ROS node and the Zenoh session. `ros.py` is the interface of the node, which
`node.py` implements over DDS, and is the only file that imports rclpy, and `rmw_zenoh.py` over Zenoh.
"""
