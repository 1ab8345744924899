"""How the contract travels: sessions, links, certificates on the wire, routers, and the limits of what a client may do.

connect.py      opens Zenoh's session of a hub, a client or a router, with its certificates
session.py      a Zenoh session: bytes; only connect.py and session.py import Zenoh
bus.py          the Bus over a Zenoh session
limits.py       what the hub permits its clients (pure)
local_socket.py     the hub's socket for programs of its user
router.py       Zenoh's settings of a router (pure)
link_trouble.py     why a link is refused: Zenoh's log lines as sentences (pure); log.py reads them
"""
