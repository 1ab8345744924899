"""The operator's terminal: bytes -> keys -> pilot -> velocity -> Twist -> bus.

    controls.py    what the keys do in each way of control. Start here
    keymap.py      which key asks for what of the program
    keys.py        the terminal's bytes -> keys, with their releases where it tells them
    pilot.py       what a pilot is: keys and time in, a velocity out
    incremental.py control by steps (setpoint.py), the default
    hold.py        control by holding a key; repeats.py tells by its repeats alone whether one is held
    gamepad.py     control by a gamepad; gamepad_*.py find and read it
    ramp.py        between what is asked for and what is sent
    rate.py        a fixed rate that neither drifts nor catches up
    bell.py        when to ring for something near
    pulse.py       whether anybody at the other end of the terminal still draws
    holder.py      one program for each source's name; refusals.py tells when the supervisor hears another one for good
    telemetry.py   what the robot and its supervisor tell
    view.py        everything that a display shows; words.py puts the supervisor's mode into words
    display.py     one line of it; dashboard.py, with top_view.py, the whole screen; screen.py the output for that
    footprint.py   what the picture needs of the supervisor's section
    config.py      [teleop] of robot.toml
    service.py     the asyncio shell: one loop reads the keys and sends the heartbeat, so a hang stops both
    terminal.py    the terminal itself: keys in, pictures out, everything restored at the end
    path/          a source of its own, that drives along a path

The pilots, the displays and what they are made of are pure: no clock, no I/O, no asyncio.
"""
