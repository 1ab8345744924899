"""The safety supervisor: the only writer of `cmd_vel`.

    safety.py         the law: step(state, now, inputs) -> (state, decision). Start here
    stop_rules.py     its table: who raises each stop reason, what it latches, what clears it
    model.py          its types: configuration, inputs, state, decision
    explain.py        what is known of a cause beyond its name
    clearance.py      the speed barrier: how fast toward what, for any hull
    scan.py           what one lidar's scans prove, beam by beam
    seen_space.py     where something may stand that no scan rules out
    near_memory.py    what earlier scans showed near the robot
    base_motion.py    whether the base follows its commands
    transition.py     intermediate twists between the present and the commanded one
    reckoning.py      where the robot has gone since a scan
    lidar.py          what a reading means: REP 117 and its dialects
    law_codec.py      the law's types as JSON and back, exactly
    config.py         [supervisor] of robot.toml
    lidar_config.py   its lidars
    fit.py            its numbers against those of the base, [sim]
    estop_record.py   a pressed e-stop on disk, written beside the loop
    estop_files.py    its files
    messages.py       wire messages -> inputs, decision -> wire messages
    blackbox.py       the last minute of inputs and decisions, for a file at every stop
    blackbox_file.py  that file
    service.py        the asyncio shell: bytes in, one step, bytes out

All but the last nine are pure: no clock, no I/O, no asyncio, no logging.
"""
