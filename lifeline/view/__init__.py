"""`lifeline view`: a robot, a recording or an incident in the Rerun viewer. Only `rerun_log.py` imports Rerun."""
