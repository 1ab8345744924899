"""The safety law: `safety.step(state, now, inputs) -> (state, decision)`. Start in `safety.py`.

Pure: no clock, no I/O, no event loop, no log. Time is an argument, in seconds of the monotonic clock of the supervisor.
"""
