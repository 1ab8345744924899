"""`lifeline soak`: drive about for hours, and see whether anything grows, gets late, or stops without a cause.

usage.py    memory, descriptors and threads of a process
hand.py     what the operator does next; pure
heard.py    gaps, lateness and losses of a stream of samples, and stops that nobody provoked; pure
sample.py   what is written down each ten seconds
judge.py    growth as a robust slope, and the verdict; pure
plot.py     the samples as an SVG; pure
run.py      the command
"""
