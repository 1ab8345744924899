"""An e-stop station in a terminal (`lifeline estop --name door`). Pure, except for `service.py`."""
