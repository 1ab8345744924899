"""An e-stop station in a terminal (`lifeline estop --name door`).

lease.py     proves its presence to the supervisor, and knows whether it is heard (pure)
face.py      what the screen shows (pure)
service.py   the loop: keys, messages and screen
"""
