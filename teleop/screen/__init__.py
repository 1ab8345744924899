"""What the operator sees: `view.py` has the values, and the displays convert them to lines. Pure."""
