"""`python -m teleop` with a hang limit of 10 s.

Teleop treats a heartbeat that is 0.15 s late as a hang and returns to zero. A busy machine can delay any process that
long, so tests of other behaviour use this program.
"""

import runpy

from teleop import service

service.HANG_S = 10.0
runpy.run_module("teleop", run_name="__main__", alter_sys=True)
