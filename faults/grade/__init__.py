"""`lifeline grade`: mark a program that drives the simulated robot by what the robot does when the program fails.

`command.py` is the command. `exam.py` starts the program once for each fault, drives, injects the fault and watches the wheels. `robot.py` is the simulated robot,
alone or behind a supervisor, `program.py` the program in a terminal, `ros_robot.py` the robot's node in ROS 2. `rubric.py` has points and
limits, `marks.py` applies them, `report.py` presents the marks. `leftovers.py` ends what an exam started.
"""
