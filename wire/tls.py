"""Endpoints with mutual TLS: tls/ and quic/, what they need, and Zenoh's settings for them (pure).

Both sides prove who they are with a certificate of the same authority (bundle.py), and nothing falls back to a link without
encryption. Over QUIC, samples that are useful only while fresh are sent as datagrams, which a lost packet does not delay,
and all others in streams, which repeat what was lost (`mixed_rel`, zenoh #2476).
"""

import ipaddress
from collections.abc import Iterable

from wire.bundle import Bundle
from wire.roles import ANY, SERVERS, Role

MIXED_RELIABILITY = "?mixed_rel=1"
SECURE = ("tls", "quic")
LEASE_S = 0.4
"""Measured: 0.1 s never expired wrongly in 60 s under 8 CPU hogs."""
QUIC_LEASE_S = 2.0
NOT_A_HUB = "the other side is neither a supervisor nor a router: its certificate has another role"
UNPROTECTED_ROUTER = "a router on another computer must have an endpoint tls/ or quic/, which both sides prove with certificates"
READING_ROUTER = (
    'a router without certificates passes no command on, unless without_certificate is "participant"'
)
EVERY_ADDRESS = ("0.0.0.0", "[::]")  # noqa: S104 - compared only
SOON_S = 3 * 86400.0
"""A certificate that ends within this time needs a new one."""


def is_secure(endpoint: str) -> bool:
    """Return whether an endpoint needs certificates."""
    return endpoint.partition("/")[0] in SECURE


def zenoh_endpoint(endpoint: str) -> str:
    """Return the endpoint as Zenoh needs it: over QUIC with mixed reliability, unless the endpoint decides."""
    return endpoint + MIXED_RELIABILITY if endpoint.startswith("quic/") and "?" not in endpoint else endpoint


def lease_s(endpoints: Iterable[str]) -> float:
    """Return how long a silent link counts as alive, for a session with these endpoints.

    The keep-alives of QUIC are in a stream, which one lost packet stops for more than a round trip; the age of the data stops
    the robot in the meantime (docs/link.md).
    """
    return QUIC_LEASE_S if any(one.startswith("quic/") for one in endpoints) else LEASE_S


def client_endpoint(endpoint: str) -> str:
    """Return the endpoint at which a client of this machine reaches a hub that listens on every address.

    No certificate names such an address, and so a client could not verify the hub's.
    """
    host = host_of(endpoint)
    return endpoint.replace(f"/{host}:", "/127.0.0.1:", 1) if host in EVERY_ADDRESS else endpoint


def host_of(endpoint: str) -> str:
    """Return the host of an endpoint, an IPv6 address in brackets."""
    return endpoint.partition("/")[2].rpartition(":")[0]


def port_of(endpoint: str) -> str:
    """Return the port of an endpoint."""
    return endpoint.partition("?")[0].rpartition(":")[2]


def is_loopback(endpoint: str) -> bool:
    """Return whether an endpoint is reachable only from this machine."""
    host = host_of(endpoint).strip("[]")
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def without_keys(endpoint: str) -> str:
    """Return the sentence that refuses a secure endpoint without keys."""
    return (
        f"{endpoint} needs certificates: make them with `lifeline keys`, and name the directory of the bundle with --keys DIR "
        "or [bus] keys"
    )


def misfit(bundle: Bundle, endpoint: str, namespace: str, *, server: Role | None) -> str | None:
    """Return in one sentence why a bundle does not fit its use; None if it does.

    Args:
        bundle: a bundle that is valid now.
        endpoint: where the hub or the router listens, or a client connects.
        namespace: of the robot.
        server: the role of the hub or the router; None: the process is a client.
    """
    who = f"the certificate of {bundle.name} ({bundle.certificate.parent})"
    if not bundle.is_for(namespace):
        other = "" if namespace == ANY else ", or change [bus] namespace"
        return (
            f"{who} is for the robot {bundle.namespace}, not for {namespace}: issue one with `lifeline keys issue NAME "
            f"--robot {namespace}`{other}"
        )
    host = host_of(endpoint)
    if server is None and bundle.role in SERVERS:
        return (
            f"{who} has the role {bundle.role}, which only a server has: issue one for this program, for instance with "
            "`lifeline keys issue NAME --role base` for the base"
        )
    if server is None:
        return (
            f"{endpoint}: a certificate cannot be checked against an IPv6 address: give a host name or an IPv4 address"
            if host.startswith("[")
            else None
        )
    if bundle.role is not server:
        return f"{who} has the role {bundle.role}: the {server} needs one of `lifeline keys issue NAME --role {server}`"
    if is_secure(endpoint) and host not in EVERY_ADDRESS and not _names(bundle, host.strip("[]")):
        return (
            f"{who} is not for the host {host}, where others connect: issue it with `lifeline keys issue {bundle.name} "
            f"--host {host}`"
        )
    return None


def _names(bundle: Bundle, host: str) -> bool:
    """Return whether a certificate names a host, or an address in any notation."""
    return _normal(host) in {_normal(name) for name in bundle.hosts}


def _normal(host: str) -> str:
    try:
        return str(ipaddress.ip_address(host))
    except ValueError:
        return host.lower()


def ends_soon(bundle: Bundle, now_s: float) -> str | None:
    """Return a warning if a certificate ends soon; None if it does not.

    Args:
        bundle: a bundle that is valid now.
        now_s: the time, in seconds since the epoch.
    """
    left_s = bundle.ends_s - now_s
    if left_s >= SOON_S:
        return None
    left = f"{left_s / 86400.0:.1f} days" if left_s >= 86400.0 else f"{left_s / 3600.0:.1f} hours"
    return (
        f"the certificate of {bundle.name} ends in {left}, and the link with it: issue a new one with `lifeline keys issue "
        f"{bundle.name}`"
    )


def has_ended(bundle: Bundle) -> str:
    """Return the sentence for a certificate that ended while the link was open."""
    restart = f", and restart the {bundle.role}" if bundle.role in SERVERS else ""
    return (
        f"the link is closed, because the certificate of {bundle.name} has expired: issue a new one with `lifeline keys issue "
        f"{bundle.name}`, copy its bundle to {bundle.certificate.parent}{restart}"
    )


def is_hub_name(common_name: str | None) -> bool:
    """Return whether the other side of a client's link is a supervisor or a router of our authority.

    Zenoh also trusts the public authorities of the web; these never sign such a name.
    """
    return common_name is not None and common_name.partition("@")[0] in SERVERS and "@" in common_name


def settings(bundle: Bundle) -> dict[str, str | bool]:
    """Return the values of Zenoh's `transport/link/tls`: mutual TLS, and links that end with their certificate."""
    certificate, key = str(bundle.certificate), str(bundle.key)
    return {
        "root_ca_certificate": str(bundle.authority),
        "listen_certificate": certificate,
        "listen_private_key": key,
        "connect_certificate": certificate,
        "connect_private_key": key,
        "enable_mtls": True,
        "verify_name_on_connect": True,
        "close_link_on_expiration": True,
    }
