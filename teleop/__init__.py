"""The operator's terminal: keys -> action -> setpoint -> Twist -> bus.

    keymap.py     which key asks for what. Start here
    keys.py       the terminal's bytes -> keys
    setpoint.py   what the operator asks of the robot, in steps within limits
    display.py    the one line: what is asked, what the supervisor permits, what to do next
    rate.py       a fixed rate that neither drifts nor catches up
    config.py     [teleop] of robot.toml
    service.py    the asyncio shell: one loop reads the keys and sends the heartbeat, so a hang stops both
    terminal.py   the terminal itself: cbreak mode, bytes in, line out, restored at the end

All but the last two are pure: no clock, no I/O, no asyncio.
"""
