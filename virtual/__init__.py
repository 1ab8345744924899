"""The virtual clock and network: services run on them in one event loop, without waiting and without sockets.

Neither wire nor a service imports this package.
"""
