"""The contract between the processes: what is said, on which key, in which bytes, and how it travels.

topics.py       every key, with its message type, writer and rate (one table)
messages.py     the messages and their CDR bytes (rosbags); msg/ says what they are made of
ros.py          those of them that are ROS 2's own
reasons.py      why the robot stands, by name and in words for every screen
stamp.py        the attachment of each sample: sequence, source time, epoch
freshness.py    how old a command is by it, whatever the network did (pure)
bus.py          the Bus that services use, and the inbox between threads
zenoh_bus.py    the Bus over Zenoh: the one file that imports it
config.py       robot.toml, read strictly
quantities.py   the bounds of its numbers
command_line.py what the processes' command lines share
extras.py       the extras of an installation, and how to install a missing one
process.py      a process that always ends: signals, exceptions, a bounded close
memory_keeper.py    and whose end its peers see at once
"""
