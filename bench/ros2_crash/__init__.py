"""What a ROS 2 robot does when its operator's keyboard node dies, hangs or is unplugged, without and with Lifeline.

trial.py       the cases, the trials with their file, and the table
stage.py       robot, observer and keyboard node as real processes, and one trial with them
__main__.py    python -m bench.ros2_crash, in a network namespace, so that no packet leaves this machine
"""
