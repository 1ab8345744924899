"""The operator's terminal: bytes -> keys -> pilot -> velocity -> Twist -> bus.

    controls.py    the keys of each control mode, and their help. Start here
    keys.py        the terminal's bytes -> keys, with releases if the terminal reports them; keys for the program itself
    pilot.py       interface of a pilot: keys and time in, a velocity out; the ramp that limits its acceleration
    keyboard.py    control by steps, the default, or by holding a key, which is also detected from its repeats
    gamepad.py     control by a gamepad; gamepad_*.py find and read it
    guards.py      what forbids motion: refusals, two robots with one namespace, late answers, a hung terminal
    rate.py        a fixed rate without drift and without catching up; when to ring the bell for a near obstacle
    holder.py      one program for each source name
    telemetry.py   status, odometry and scans
    view.py        all displayed values
    display.py     the supervisor's mode in words, and the display of one line
    dashboard.py   the whole screen, with top_view.py; screen.py is its output
    config.py      [teleop] of robot.toml, and the robot in the picture
    service.py     the asyncio shell: one loop reads the keys and sends the heartbeat, so a hang stops both
    terminal.py    the terminal: keys in, pictures out, restored at the end, by terminal_guard.py if teleop is killed
    station/       an e-stop station in a terminal
    path/          a separate command source that drives along a path

The pilots, the displays and their parts are pure: no clock, no I/O, no asyncio.
"""
