"""Autonomous driving along a path, as a command source under the supervisor.

    pose.py       poses, and paths as arrays of them
    shapes.py     square and circle
    trail.py      the odometry of a recording -> a path
    legs.py       a path -> legs without stops, with turns on the spot between them
    progress.py   progress along a leg, which never decreases
    pursuit.py    pure pursuit along a leg, and the turn on the spot
    course.py     all legs of a path in sequence
    track.py      statistics of the distance from the path
    permit.py     conditions for driving, and causes of a stop
    offbeat.py    detects key presses of the operator from extra samples between heartbeats
    service.py    the asyncio shell

All but the last are pure: no clock, no I/O, no asyncio.
"""
