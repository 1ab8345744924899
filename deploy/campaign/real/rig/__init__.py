"""The robot under test: the whole stack as it is run, with a way to break each part of it, and who watches.

stage.py            supervisord, supervisor, sim, teleop, observer, links: up, down, and in order again
faulty_process.py   one of our processes with faults in it, which a signal sets off
proxy.py, links.py  TCP links that can be cut, delayed, healed: the process, and the campaign's end of it
cable.py            a network namespace and a cable, where root allows them
attacker.py         the process that says what attacks.py has
observer.py         what is seen of a trial: a client of the wire of its own, and the wheels
wheels.py           what the base does, told past the network
janitor.py          cleans up after a campaign that was killed
helper_process.py   a process that takes orders on its stdin
"""
