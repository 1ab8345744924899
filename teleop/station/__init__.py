"""An e-stop station in a terminal (`lifeline estop --name door`).

state.py     proves its presence to the supervisor, knows whether it is heard, and what the screen shows (pure)
service.py   the loop: keys, messages and screen
"""
