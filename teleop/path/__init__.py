"""A path that the robot drives by itself, as one more command source under the supervisor.

    pose.py       poses, and paths as arrays of them
    shapes.py     square and circle
    trail.py      the odometry of a recording -> a path
    legs.py       a path -> legs that are driven in one go, with a turn on the spot between them
    progress.py   where along a leg the robot is: only ever onwards
    pursuit.py    pure pursuit along a leg, and the turn on the spot
    course.py     leg after leg to the end
    track.py      how far from the path the robot was
    permit.py     what must hold before it drives, and what makes it stop
    offbeat.py    hears a key of the operator in the rhythm of their heartbeat
    service.py    the asyncio shell

All but the last are pure: no clock, no I/O, no asyncio.
"""
