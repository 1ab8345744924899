"""The running robot as one thing: what several commands need to start, find, observe and end it.

bringup.py      sim and supervisor: start, wait until alive, stop
preflight.py    the configuration and the scene, and whether they fit together, before anything starts
robot_file.py   every section of a robot.toml, against each other
launch.py       what the children are started with, checked before anything starts
supervisord.py  supervisord itself: fetched by uv, asked over its socket
processes.py    which processes belong to a state directory, and signals to them
statedir.py     the state directory: its files, its lock
keyboard.py     the real teleop on a pseudo-terminal, and a hand that types
observe.py      what a client of the wire sees, with the time of each arrival
samples.py      what the robot is told and does, as several commands see it (pure)
reach.py        a client's way onto the wire, for commands that stay there until Ctrl-C
statusline.py   one line that changes in place, on a terminal
interrupts.py   SIGINT, SIGTERM and SIGHUP as one exception, once
errors.py       what is told in one sentence and ends with exit code 2
"""
