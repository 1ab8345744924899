"""Starts the processes of a robot with supervisord, systemd or a container, and issues its certificates.

`robot.toml` has every key of the configuration with its default; `examples` has files of real robots.
Nothing here imports `lifeline` or `faults`.
"""
