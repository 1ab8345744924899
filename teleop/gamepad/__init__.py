"""Control by a gamepad: `find.py` chooses the device, `device.py` reads it, `pad.py` converts its events to a velocity (pure)."""
