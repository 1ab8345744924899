"""Shared modules of the inspection commands topic, node, graph and doctor.

keys.py        names of topics as users write them, and their types
sockets.py     which process is at the other end of a TCP connection
nodes.py       which session declares what, as the hub reports it, joined with the processes: the nodes of the system
traffic.py     rates, sizes, ages and writers of the samples that were heard
values.py      messages as YAML, CSV and single fields, and YAML as messages
listening.py   connects to the hub and runs a command until Ctrl-C
"""
