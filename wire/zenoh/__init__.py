"""How the contract travels: sessions, links, routers, and the limits of what a client may do.

Only `connect.py` and `session.py` import Zenoh.
"""
