"""The operator's terminal: bytes -> keys -> pilot -> velocity -> Twist -> bus.

    controls.py    the keys of each control mode. Start here
    keymap.py      keys for the program itself
    keys.py        the terminal's bytes -> keys, with releases if the terminal reports them
    pilot.py       interface of a pilot: keys and time in, a velocity out
    incremental.py control by steps (setpoint.py), the default
    hold.py        control by holding a key; repeats.py detects a held key from its repeats
    gamepad.py     control by a gamepad; gamepad_*.py find and read it
    ramp.py        acceleration limit of the sent velocity
    rate.py        a fixed rate without drift and without catching up
    bell.py        when to ring the bell for a near obstacle
    pulse.py       whether the terminal still shows the output
    holder.py      one program for each source name; refusals.py detects permanent refusal by the supervisor;
                   supervisors.py detects two robots with one namespace
    round_trip.py  how late the robot answers a command
    telemetry.py   status, odometry and scans
    view.py        all displayed values; words.py has texts for the supervisor's mode
    display.py     display of one line; dashboard.py, with top_view.py, the whole screen; screen.py its output
    footprint.py   values of the supervisor's section for the picture
    config.py      [teleop] of robot.toml
    service.py     the asyncio shell: one loop reads the keys and sends the heartbeat, so a hang stops both
    terminal.py    the terminal: keys in, pictures out, restored at the end
    station/       an e-stop station in a terminal
    path/          a separate command source that drives along a path

The pilots, the displays and their parts are pure: no clock, no I/O, no asyncio.
"""
