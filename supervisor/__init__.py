"""The safety supervisor: the only writer of `cmd_vel`.

    safety.py         the law: step(state, now, inputs) -> (state, decision). Start here
    stop_rules.py     table of stop reasons: what raises each, what it latches, what clears it
    model.py          its types: configuration, inputs, state, decision
    estop_stations.py leases of the e-stop stations
    explain.py        texts with the details of a cause
    clearance.py      the speed barrier: permitted speed toward obstacles, for any hull
    scan.py           interpretation of one lidar's scans: returns and free space, by beam
    seen_space.py     hidden places, where an obstacle may stand that no scan shows
    near_memory.py    memory of near returns in earlier scans
    base_motion.py    whether the base follows its commands
    transition.py     intermediate twists between the present and the commanded one
    reckoning.py      dead reckoning since a scan
    lidar.py          meaning of lidar readings: REP 117 and the conventions of real sensors
    config.py         [supervisor] of robot.toml with its lidars, and its consistency with the base in [sim]
    messages.py       wire messages -> inputs, decision -> wire messages
    estop_record.py   record of a pressed e-stop: its files, written on threads beside the loop
    blackbox/         recording of the last minute, written to a file at every stop
    service.py        the asyncio shell: bytes in, one step, bytes out

All but the last three are pure: no clock, no I/O, no asyncio, no logging.
"""
