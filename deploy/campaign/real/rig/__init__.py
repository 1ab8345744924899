"""The robot under test: the whole stack as it is run, with a way to break each part of it, and who watches.

stage.py            start, stop and restore supervisord, supervisor, sim, teleop, observer and links
faulty_process.py   one of our processes with faults in it, which a signal sets off
proxy.py, links.py  TCP links that can be cut, delayed, healed: the process, and the campaign's end of it
cable.py            a network namespace and a cable, where root allows them
attacker.py         the process that publishes the messages of attacks.py
observer.py         records a trial: a separate Zenoh client, and the wheels
wheels.py           motion of the base, reported through a pipe instead of the network
janitor.py          cleans up after a campaign that was killed
helper_process.py   a process that takes orders on its stdin
"""
