"""`python -m teleop` with patience: a hang limit of 10 s, and as much for the terminal's answers, which are all remembered.

Teleop treats a heartbeat that is 0.15 s late as a hang, and a terminal without an answer for 0.3 s as lost, and returns to
zero. A busy machine can delay any process that long, so tests of other behaviour use this program.
"""

import runpy

from teleop import guards, service, terminal

service.HANG_S = guards.ANSWER_LIMIT_S = 10.0
guards.TRIES = 1000
terminal.ANSWER_LIMIT_S = 2.0
runpy.run_module("teleop", run_name="__main__", alter_sys=True)
