"""The safety supervisor: the only writer of `cmd_vel`.

`service.py` is the asyncio shell: bytes in, one step, bytes out. `law/` decides, `blackbox/` records, and `estop_record.py` keeps a
pressed e-stop over the death of every process.
"""
