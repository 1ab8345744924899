"""Starts, finds, observes and stops the running robot, for several commands.

bringup.py      check the configuration, start the nodes of a robot, and wait until they are alive; preflight.py checks the scene
takedown.py     stop all processes of a state directory; `lifeline down`
robot_file.py   read and check all sections of a robot.toml
ros2_program.py run the ROS 2 process in an environment of its own; ros2_reports.py what it reports of its topics
launch.py       arguments and environment of the processes, and a check of the endpoint
supervisord.py  fetch supervisord with uv, start it, and query it over its socket; ../supervisord_plugin runs in it
processes.py    find the processes of a state directory, and signal them
statedir.py     the state directory: its files and its lock
keyboard.py     run the real teleop on a pseudo-terminal, and type keys
reach.py        connect a client to the hub, and observe which nodes are alive, the newest status and the newest odometry
listen.py       the address on which a command serves
formatting.py   the mode, speed and nearest distance of a robot as text
errors.py       errors that are reported in one sentence, exit codes 2 and 3, and signals that end a command
"""
