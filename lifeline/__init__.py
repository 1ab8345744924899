"""The command-line tool `lifeline`: starts, drives, shows, explains and tests a robot.

`cli/` declares the options of every command, with the decorators of `command.py`; each other file or folder has one command or
one group of commands.
"""
