"""Autonomous driving along a path, as a command source under the supervisor.

    course.py     paths, from a pose to the progress along a leg, and from a recording's odometry. Start here
    pursuit.py    the velocity that follows a path
    permit.py     conditions for driving, and causes of a stop
    service.py    the asyncio shell

All but the last are pure: no clock, no I/O, no asyncio.
"""
