"""The campaign with real processes.

runner.py       many trials: order, file, resume, exit code; progress.py the progress display
trial_run.py    one trial: drive, break, watch, recover, judge
times.py        times from the fault to a lasting zero (pure)
injectors/      one injector for each kind of fault
rig/            the robot under test, its observer, and the means to break it
"""
