"""The process on its machine: command line, configuration, state directory, limits, signals and systemd. Imports nothing of Zenoh."""
