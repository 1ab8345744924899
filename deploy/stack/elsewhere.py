"""Find out whether an endpoint is on another machine, whose robot the processes and records of this machine do not describe."""

import socket

from wire import tls


def silence(endpoint: str) -> str | None:
    """Return why nothing can be heard at an endpoint on another machine; None if it is on this machine."""
    host = tls.host_of(endpoint).strip("[]")
    try:
        family, *_, address = socket.getaddrinfo(host, 0, type=socket.SOCK_DGRAM)[0]
    except (OSError, UnicodeError):
        return f"the name {host} of the endpoint cannot be resolved"
    try:
        with socket.socket(family, socket.SOCK_DGRAM) as probe:
            probe.bind(address)  # only to an address of this machine
    except OSError:
        return f"nothing answers at {endpoint}, which is on another machine"
    return None
