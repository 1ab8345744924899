"""Measures how many robots one machine can supervise: `python -m bench.robots`; with `--router`, how many one router serves.

Each robot has its own supervisor process and endpoint, as if it were alone. The rates are those of a real robot:
scans at 20 Hz, odometry at 50 Hz, commands at 20 Hz. The bench's own cost is measured and reported beside the results.
"""
