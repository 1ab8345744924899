"""Inject each class of faults into real processes.

injection.py   the base class of a fault: prepare, do, lift
processes.py   kill, stop, block or end processes, also supervisord
sensors.py     faults of the simulated sensors
network.py     links that are cut, delayed or unplugged
wire.py        an attacker on the wire; a clock that steps
machine.py     lack of CPU, memory or disk space
plans.py       all faults by name, and pairs
"""
