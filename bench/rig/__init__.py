"""What the benchmarks share: feeds of sensor data, a supervisor, a terminal, and the tables of results."""
