"""What starts the processes of a robot: `lifeline up`, supervisord, units of systemd, a container; and `lifeline keys`, its certificates.

`robot.toml` has every key of the configuration with its default; `examples` has files of real robots. Nothing here imports
`lifeline` or `faults`.
"""
