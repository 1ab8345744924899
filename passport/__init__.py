"""The stop-time passport: how far a robot moves after each fault, measured before a flat wall.

record.py has the record of a measurement and its JSON form.
"""
