"""`python -m tests.fuzz`: what a stranger may send, a million of it, against everything that takes something in.

places.py      where the floats, integers and lengths of an encoded message are
payloads.py    valid messages, and what becomes of them: the same for the same seed and number
decoding.py    bytes -> Subscription -> the conversions of supervisor, sim and teleop; time and memory of each
driving.py     the real supervisor on a perfect network, armed and driving while it is fed
simulated.py   the real sim, likewise
warned.py      what only warned
run.py         a whole run of all of them
__main__.py    the run, and the replay of one payload or one scene of it
"""
