"""`python -m teleop` that takes only a long pause for a hang.

A beat that is 0.15 s late is a hang, and lets go of everything; on a busy machine that may happen to any process. For
tests of something else.
"""

import runpy

from teleop import service

service.HANG_S = 10.0
runpy.run_module("teleop", run_name="__main__", alter_sys=True)
