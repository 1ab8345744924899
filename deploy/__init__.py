"""Starts the processes of a robot, and makes the certificates of those who may use it.

up.py              `lifeline up`: start the stack, with teleop in this terminal
stack/             start, find, observe and stop the running robot
keys/              `lifeline keys`: an authority, its certificates, and the bundles for other computers
supervisord.conf   the programs that supervisord runs; supervisord_plugin/ runs in it
robot.toml         every key of the configuration, with its default
systemd/           the units that start a real robot at boot
examples/          configurations of real robots and of zenoh-bridge-ros2dds

`up.py` and keys/ use stack/, never the reverse. The other commands of `lifeline` are in the package lifeline.
"""
