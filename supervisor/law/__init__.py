"""The safety law: `safety.step(state, now, inputs) -> (state, decision)`. Start in `safety.py`.

    inputs ─► base ─► sight ─► causes ─► interlock ─► permission ─► decision

Each part has its own state and file: `base.py` (odometry, braking), `sight.py` (scans, memory, unseen space) and
`interlock.py` (sources, latches, owner, e-stop). `state.py` combines them.
Pure: no clock, no I/O, no event loop, no log. Time is an argument, in seconds of the monotonic clock of the supervisor.
"""
