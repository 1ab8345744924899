"""The fault campaign: every class of fault, at random moments, with the promises checked on every sample.

`classes.py` has one row for each class, `injection.py` one draw and one sequence of steps, over the port in `port.py`, which the
real stage (`real/`) and the simulated world (`simulated/`) implement. `promises.py` judges what was seen, `report/` presents it.
"""
