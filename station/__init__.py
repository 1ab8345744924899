"""The web page of an e-stop station: the browser of a phone holds the lease, shows the robot, and may drive it (`lifeline station`).

    pairing.py    who may hold the lease: one-time codes and sessions (pure)
    admission.py  which requests are served: Host and Origin (pure)
    visitors.py   how long a connection of a stranger lasts
    messages.py   the messages between page and server (pure)
    driving.py    one page at a time drives the robot
    relay.py      carries leases between the pages and the supervisor
    web.py        the page and its websockets: the lease, the pictures of the robot, and driving
    server.py     the HTTP server

The browser runs the files in the folder page.
"""
