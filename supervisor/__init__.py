"""The safety supervisor: the only writer of `cmd_vel`.

`service.py` is the asyncio shell: bytes in, one step, bytes out. `law/` decides, `blackbox/` records, and
`estop_record.py` preserves a pressed e-stop when every process has died.
"""
