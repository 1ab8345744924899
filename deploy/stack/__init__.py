"""Starts, finds, observes and stops the running robot. Start in `bringup.py`; `launch.py` has the command lines of the processes."""
