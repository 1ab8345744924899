"""Benchmarks of time. They are not tests and never fail; `python -m bench` measures the law, the supervisor process, and its restart.

Each other program has its own `--help`: `bench.peers`, `bench.robots`, `bench.link` and `bench.soak`. They share `rig/`.
No verdict is about a time alone: it compares with a reference of the same run, and is given only if the machine was idle.
"""
