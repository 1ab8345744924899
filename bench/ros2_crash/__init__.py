"""What a ROS 2 robot does when its operator's keyboard node dies, hangs or is unplugged, without and with Lifeline.

trial.py       the cases, the result of one trial, and its line in the file (pure)
table.py       the results of all trials as a table (pure)
results.py     the file of the trials
stage.py       robot, observer and keyboard node as real processes; with Lifeline, also supervisor and ros2
run.py         drive at 0.5 m/s, inject the fault, and measure until standstill
isolation.py   a network namespace, so that no packet leaves this machine, and a cable to unplug
__main__.py    python -m bench.ros2_crash
"""
