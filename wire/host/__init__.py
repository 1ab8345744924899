"""The process on its machine; imports the contract in `wire`, and nothing of Zenoh.

config.py       robot.toml, strictly checked
command_line.py     shared parts of the processes' command lines
extras.py       the extras of an installation, and how to install a missing one
state_directory.py      where logs, black boxes and the e-stop record are
turns.py        the turns of a service: one for all samples that arrive together
pauses.py       the time in suspend, and stalls of the event loop
notify.py       reports to systemd: ready, running, stopping
process.py      guaranteed end of a process: signals, exceptions, a bounded close
process_limits.py   open files, memory and closing sockets of this process
memory_keeper.py    helper process, so that a killed process's sockets close immediately
"""
