"""`lifeline check`: what a configuration permits, its risks, and the topics of a ROS 2 robot."""
