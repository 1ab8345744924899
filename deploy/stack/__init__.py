"""Starts, finds, observes and stops the running robot, for several commands.

bringup.py      start the nodes of a robot, and wait until they are alive
takedown.py     stop all processes of a state directory
preflight.py    check the configuration before the start; preflight_sim.py the scene and the simulated robot
robot_file.py   read and check all sections of a robot.toml; ros2_fit.py the section of ROS 2 against the others
ros2_program.py how the ROS 2 process is started in an environment of its own
launch.py       arguments and environment of the processes, and a check of the endpoint
supervisord.py  fetch supervisord with uv, start it, and query it over its socket; ../supervisord_plugin runs in it
processes.py    find the processes of a state directory, and signal them
ros2_reports.py what the ROS 2 process reports of its topics
statedir.py     the state directory: its files and its lock
bound_child.py  run a program in the foreground so that neither of the two processes outlives the other
keyboard.py     run the real teleop on a pseudo-terminal, and type keys
observe.py      which nodes are alive, the newest status and the newest odometry
elsewhere.py    why nothing answers at an endpoint on another machine
reach.py        connect a client to the hub, for commands that run until Ctrl-C
statusline.py   a status line that is updated in place on a terminal
interrupts.py   raise one exception on SIGINT, SIGTERM or SIGHUP
errors.py       errors that are reported in one sentence; exit codes 2 and 3
"""
