"""`lifeline soak`: drive for hours; detect growth, lateness, and stops without a cause.

usage.py    memory, descriptors and threads of a process
hand.py     the simulated operator; pure
heard.py    gaps, lateness and losses of a stream of samples, and stops without a cause; pure
sample.py   the sample of each ten seconds
judge.py    growth as a robust slope, and the verdict; pure
plot.py     the samples as an SVG; pure
run.py      the command
"""
