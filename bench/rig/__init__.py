"""What the benchmarks share.

options.py     the command line of a bench, and its end
program.py     child processes: commands, and programs that read and answer lines
terminal.py    a command in a pseudo-terminal
feed.py        a supervisor under measurement, and the robot that feeds it (scenery.py: its scans)
load.py        processor time and memory of processes and of the machine
stored.py      stored runs as JSON lines, with command, date, machine and commit
sheet.py       tables and verdicts, on the terminal and in markdown
"""
