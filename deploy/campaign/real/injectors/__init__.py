"""How each class of faults is done to real processes.

injection.py   what a fault of a trial is: prepare, do, lift
processes.py   killed, stopped, blocked, ended; also supervisord
sensors.py     of the sim, on request
network.py     links that are cut, slow, or unplugged
wire.py        an attacker on the wire; a clock that steps
machine.py     hogs, memory, a full disk
plans.py       all of them by name, and pairs
"""
