"""`lifeline view`: a robot, a recording or an incident in the Rerun viewer.

shapes.py       shapes, values and texts to draw, in metres, in named frames; the hull, its rings and free space (pure)
scene.py        what each message draws; recordings and black boxes, with the configuration in them
rerun_log.py    logs primitives to Rerun, and the layout of the viewer: the only file that imports it
window.py       the viewer as a separate process, and the page of the web viewer, on loopback only and without analytics
show.py         the command
"""
