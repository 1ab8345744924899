"""The campaign with real processes.

runner.py       many trials: order, progress, file, resume, exit code
trial_run.py    one trial: drive, break, watch, recover, judge
real_faults.py  the faults that only real processes can have; pairs
demo.py         `lifeline demo`: a few trials and a drive at a rack, each judged by one promise
rig/            the robot under test, its observer, and the means to break it
"""
