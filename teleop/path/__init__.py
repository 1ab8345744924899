"""Autonomous driving along a path, as a command source under the supervisor. Pure, except for `service.py`."""
