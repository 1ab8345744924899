"""`lifeline check`: what a configuration permits, its risks, and the ROS 2 side."""
