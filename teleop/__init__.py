"""The operator's terminal: bytes -> keys -> pilot -> velocity -> Twist -> bus.

Start in `service.py`, the asyncio shell: one loop reads the keys and sends the heartbeat, so a hang stops both. The pilots, the
screen and the guards are pure: no clock, no I/O, no asyncio.
"""
