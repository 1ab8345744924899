"""The first drive of a new robot: measures what the safety law is configured with.

The estimators are pure: wall.py, mounting.py, timing.py, stopping.py; estimate.py has their statistics. plan.py decides what to
drive, trace.py keeps what was heard, driver.py drives, watch.py names surprises, person.py reads the terminal, findings.py makes the results, measured.py
writes them into robot.toml, and commission.py is the command.
"""
