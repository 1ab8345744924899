"""The campaign in virtual time: equal seeds make equal trials.

runner.py             many seeds on several cores: progress, file, exit code; which code decides the outcome of a seed
trial_run.py          one seed, from its scenario to its trial
scenario.py           what happens in a trial, drawn from its seed (pure)
operator.py           the simulated operator
world.py              the processes on their virtual network, each of which can die, hang and start again
fault_injection.py    the faults' port to the simulated processes; faults that exist in virtual time only
clearance_witness.py  clearance of the hull, and how much of its decrease the robot caused
"""
