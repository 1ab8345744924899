"""Compares the supervisor with other ways to pass a command on and to notice a death: `python -m bench.peers`.

* links/: one file for each transport, with the same functions, and the message
* programs.py: the processes
* run.py: what is compared, how it is started, and the measurements
* results.py: the stored measurements, their tables and targets (pure)

Links and programs run in the environment `.peers` (`make bench-peers`), so they import nothing of Lifeline but
`links/lifeline_link.py`, which runs in `.venv`.
"""
