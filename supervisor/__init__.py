"""The safety supervisor: the only writer of `cmd_vel`.

    safety.py         the law: step(state, now, inputs) -> (state, decision). Start here
    model.py          its words: stop reasons, inputs, state, decision
    explain.py        what is known of a cause beyond its name
    clearance.py      the speed barrier: how fast toward what, for any hull
    scan.py           what a laser scan proves
    reckoning.py      where the robot has gone since a scan
    lidar.py          what a reading means: REP 117 and its dialects
    plain.py          the law's types as JSON and back, exactly
    config.py         [supervisor] of robot.toml
    lidar_config.py   its lidars
    fit.py            its numbers against those of the base, [sim]
    messages.py       wire messages -> inputs, decision -> wire messages
    blackbox.py       the last minute of inputs and decisions, for a file at every stop
    blackbox_file.py  that file
    service.py        the asyncio shell: bytes in, one step, bytes out

All but the last seven are pure: no clock, no I/O, no asyncio, no logging.
"""
