"""The process on its machine: its command line and configuration, its state directory, its end, its limits, and systemd.

Imports the contract in `wire`, and nothing of Zenoh.
"""
