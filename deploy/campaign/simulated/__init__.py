"""The campaign in virtual time: equal seeds make equal trials.

runner.py             many seeds on several cores: progress, file, exit code
revision.py           which code decides the outcome of a seed
trial_run.py          one seed, from its scenario to its trial
scenario.py           what happens in a trial, drawn from its seed (pure)
operator.py           a person at the keyboard's place
world.py              the processes on their virtual network, each of which can die, hang and start again
machine.py            what outlives their supervisor
injector.py           does to the world what the scenario says
clearance_witness.py  how near the hull is to anything, and how much of that is its own doing
"""
