"""The robot under test: the whole stack, fault injection for each part of it, and the observer.

stage.py            start, stop and restore supervisord, supervisor, sim, teleop, observer and links; the faults' port
faulty_process.py   one of our processes, with faults that a signal triggers
proxy.py            TCP links that can be cut, delayed, healed
cable.py            a network namespace and a cable, where root allows them
attacker.py         the process of an attacker of attacks.py
observer.py         record a trial: a separate Zenoh client, and the wheels
wheels.py           motion of the base, reported through a pipe instead of the network
janitor.py          clean up after a killed campaign
helper_process.py   the campaign's interface to these processes, which take orders on stdin
"""
