"""Benchmarks of time and memory. They are not tests and never fail; `python -m bench` measures the law, the supervisor, teleop and the sim.

Each other program has its own `--help`: `bench.peers`, `bench.robots`, `bench.fleet`, `bench.link` and `bench.soak`. They
share `rig/`.
"""
