"""What the benchmarks share: child processes, options, load of the machine, stored runs, and tables with goal and verdict."""
