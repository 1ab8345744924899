"""What a ROS 2 robot does when its operator's keyboard node dies, hangs or is unplugged, without and with Lifeline."""
