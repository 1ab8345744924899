"""The virtual clock and network: services run on them in one event loop, without waiting and without sockets.

loop.py         the event loop whose clock jumps to the next timer, and the processes on it that can be held or killed
network.py      the Bus over a simulated network that can fail, for the fault campaign
memory_bus.py   the Bus that delivers at once, for the component tests

Neither wire nor a service imports this package.
"""
