"""The fault campaign: every class of fault, at random moments, with the promises checked on every sample.

classes.py     the table of faults: what is done, to which process, what is expected to detect it, and how soon
injection.py   one definition of each fault for both campaigns: its draw, and its steps over a port (pure)
port.py        the port: what a fault may do to a robot
attacks.py     a client that ignores the protocol, and its messages
demands.py     what must follow from a fault, and when (pure)
seen.py        observations of a run from outside: commands, statuses, the true motion
promises.py    the promises of the design, checked on what was seen (pure)
measure.py     detector, times and distance of each stop (pure)
trial.py       the record of one trial, its timeline, and its line of JSON
trial_file.py  the file of a campaign, read and appended to; where and when the campaign ran
simulated/     the same services on a virtual clock (docs/decisions/0017)
real/          real processes over real Zenoh, with the operator's keys typed into teleop's terminal
report/        the figures of a campaign, as tables and as a page
"""
