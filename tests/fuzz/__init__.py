"""`python -m tests.fuzz`: a million hostile payloads against every component that receives any.

places.py      find the floats, integers and lengths of an encoded message
payloads.py    valid messages and their mutations; deterministic by seed and number
decoding.py    bytes -> Subscription -> the conversions of supervisor, sim and teleop; time and memory of each
driving.py     feed the real supervisor on a perfect network while it drives
simulated.py   feed the real sim
warned.py      collect warnings
run.py         run all of them
__main__.py    the command: a run, or the replay of one payload or scene
"""
