"""The campaign with real processes.

runner.py       many trials: order, file, resume, exit code; progress.py how far it is
trial_run.py    one trial: drive, break, watch, recover, judge
times.py        from the fault to a zero that lasts (pure)
injectors/      one injector for each kind of fault
rig/            the robot under test, who watches it, and what can be done to it
"""
