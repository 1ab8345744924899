"""The virtual clock and network: services run on them in one event loop, without waiting and without sockets.

loop.py      the event loop whose clock jumps to the next timer, and the processes on it that can be held or killed
network.py   the Bus over a simulated network: perfect for the component tests, until the fault campaign lets it fail

Neither wire nor a service imports this package.
"""
