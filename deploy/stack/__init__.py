"""The running robot as one thing: what several commands need to start, find, observe and end it.

bringup.py      sim and supervisor: start, wait until alive
takedown.py     end whatever runs of a state directory
preflight.py    the configuration and the scene, and whether they fit together, before anything starts
robot_file.py   every section of a robot.toml, against each other
launch.py       what the children are started with, checked before anything starts
supervisord.py  supervisord itself: fetched by uv, asked over its socket
processes.py    which processes belong to a state directory, and signals to them
statedir.py     the state directory: its files, its lock
keyboard.py     the real teleop on a pseudo-terminal, and a hand that types
observe.py      which nodes are alive, the newest status and the newest odometry
reach.py        connect a client to the hub, for commands that run until Ctrl-C
statusline.py   one line that changes in place, on a terminal
interrupts.py   SIGINT, SIGTERM and SIGHUP as one exception, once
errors.py       errors that are reported in one sentence; exit code 2 or 3
"""
