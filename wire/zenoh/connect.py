"""Opens the Zenoh session of a hub, a client or a router, and watches the certificates of its links.

The supervisor opens its session as the hub (`peer`, listening). All other processes connect to it as `client`. Every
path to the wheels therefore passes the hub, whose access control refuses any other writer of `cmd_vel`. Scouting is
disabled, and no data leaves the machine unless the endpoint is open to the network.

`python -m wire.zenoh.connect ENDPOINT NAMESPACE KEYS` tries once; a client starts it to find out why it cannot connect (log.py).
"""

import asyncio
import json
import logging
import os
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Literal

import zenoh

from wire import tls
from wire.access import LOCAL_ROLES, access_control
from wire.bundle import Bundle, BundleError, choose_bundle
from wire.bus_config import BusConfig
from wire.host.process_limits import never_linger, raise_open_files
from wire.inbox import BusError
from wire.roles import SERVERS
from wire.roles import Role as ParticipantRole
from wire.zenoh import limits, local_socket, router
from wire.zenoh.hub_proof import HubProof
from wire.zenoh.link_trouble import LOG_FILTER
from wire.zenoh.log import why_refused
from wire.zenoh.session import call_in, direct, first_line, in_thread

_log = logging.getLogger(__name__)

CONNECT_RETRY_S = 0.1
REFUSED_RETRY_S = 0.5
LOCK_RETRY_S, LOCK_RETRIES = 0.02, 5
"""Another hub that starts holds the lock of an ended one for some microseconds (local_socket.py)."""
RECONNECT_MS = 50
"""Period of a client's attempts to reconnect."""
OPEN_LIMIT_MS = 3000
"""Limit of one attempt to connect with certificates. QUIC does not notice that nobody listens, and repeats its first packet
less and less often: after Zenoh's default of 10 s, a client would notice a restarted supervisor only seconds later."""
TROUBLE_PERIOD_S = 10.0
"""Period of a client's attempts to find out why it cannot connect; each takes 0.3 s of the processor."""
IN_USE, LOCKED = "Address already in use", "acquire lock"
TX_QUEUE = 16
"""Maximum number of batches of one priority that wait to be sent: the most that Zenoh accepts."""

Role = Literal["hub", "client"]


async def open_session(
    config: BusConfig,
    role: Role,
    *,
    on_wait: Callable[[], None] | None = None,
    say: Callable[[str], None] = _log.warning,
    proof: HubProof | None = None,
) -> zenoh.Session:
    """Open the session; a client waits for its hub without a time limit.

    Args:
        config: the endpoint, the namespace, and the keys if the endpoint needs them.
        role: `hub` listens, `client` connects.
        on_wait: called once if the hub does not run yet.
        say: called in this event loop with a sentence about a certificate that ends, now or later.
        proof: of a client that takes part: a hub that it refuses is left, and the client waits for another. It is also
            told if the hub does not know this client as a participant.

    Raises:
        BusError: the hub cannot listen, the endpoint is invalid, or a certificate is refused.
    """
    if role == "client":
        config = replace(config, endpoint=tls.client_endpoint(config.endpoint))
    bundle = await in_thread(lambda: _bundle(config, role))
    if bundle is not None and (soon := tls.ends_soon(bundle, time.time())) is not None:
        say(soon)
    trouble = None if bundle is None else _Trouble(config)
    waiting = False
    while (session := await in_thread(lambda: _opened(config, role, bundle, proof))) is None:
        if not waiting and on_wait is not None:
            on_wait()
        waiting = True
        if trouble is not None:
            await trouble.check()
        await asyncio.sleep(CONNECT_RETRY_S)
    if bundle is not None:
        guard = _Guard(session, config.endpoint, bundle, say, is_client=role == "client")
        await in_thread(guard.check)
    elif proof is not None and not _is_local(session):
        proof.say(
            f"connected to {config.endpoint} without a certificate and not as the supervisor's user: the supervisor accepts "
            'nothing from this program, unless its configuration has [bus] without_certificate = "participant" (docs/access.md)'
        )
    return session


def _opened(
    config: BusConfig, role: Role, bundle: Bundle | None, proof: HubProof | None
) -> zenoh.Session | None:
    """Return the session; None if the hub of a client does not run yet, or is refused.

    Raises:
        BusError: the hub cannot listen, or the endpoint is invalid.
    """
    endpoints = _endpoints(config, role)
    try:
        session = _open(config, role, bundle, endpoints)
    except zenoh.ZError as error:
        if role == "hub":
            raise BusError(_listen_sentence(str(error), config.endpoint)) from error
        if "Unable to connect" not in str(error):
            raise BusError(f"cannot use the endpoint {config.endpoint!r}: {first_line(error)}") from error
        return None
    # The hub listens on its socket first. If it did so after the check, only the socket may be used.
    if role == "client" and endpoints != _endpoints(config, role):
        session.close()  # pyright: ignore[reportUnknownMemberType]
        return None
    if proof is not None and not proof.must_connect and not proof.check(session):
        session.close()  # pyright: ignore[reportUnknownMemberType]
        time.sleep(REFUSED_RETRY_S)
        return None
    return session


def _open(config: BusConfig, role: Role, bundle: Bundle | None, endpoints: list[str]) -> zenoh.Session:
    """Open the session; try again while the lock of the hub's socket is held.

    Raises:
        ZError: it cannot be opened.
        BusError: a value of the configuration is invalid.
    """
    settings = _configuration(config.endpoint, _settings(config, role, bundle, endpoints))
    for _ in range(LOCK_RETRIES):
        try:
            return zenoh.open(settings)
        except zenoh.ZError as error:
            if LOCKED not in str(error):
                raise
            time.sleep(LOCK_RETRY_S)
    return zenoh.open(settings)


class _Trouble:
    """Finds out whether a client waits for its hub in vain, because a certificate is refused."""

    def __init__(self, config: BusConfig) -> None:
        self._config = config
        self._next_s = 0.0
        self._refused: str | None = None

    async def check(self) -> None:
        """Try in a separate process, at most every `TROUBLE_PERIOD_S`.

        Raises:
            BusError: two processes in succession were refused for the same reason; a supervisor that ends refuses only one.
        """
        now_s = time.monotonic()
        if now_s < self._next_s:
            return
        before = self._refused
        self._refused = await refusal(self._config)
        if self._refused is None:
            self._next_s = now_s + TROUBLE_PERIOD_S
        elif self._refused == before:
            raise BusError(self._refused)


async def refusal(config: BusConfig) -> str | None:
    """Try to connect in a separate process; return in one sentence whose certificate is refused, and what to do; None if none is."""
    config = replace(config, endpoint=tls.client_endpoint(config.endpoint))
    try:
        bundle = await in_thread(lambda: _bundle(config, "client"))
    except BusError as error:
        return str(error)
    if bundle is None:
        return None
    used = bundle.certificate.parent
    reason = await why_refused(config.endpoint, config.namespace, str(used))
    if reason is None:
        return None
    return f"cannot connect to {config.endpoint}: {reason} (this program used the certificate of {bundle.name} in {used})"


class _Guard:
    """Watches the links of a session with certificates."""

    def __init__(
        self,
        session: zenoh.Session,
        endpoint: str,
        bundle: Bundle,
        say: Callable[[str], None],
        *,
        is_client: bool,
    ) -> None:
        self._session, self._endpoint, self._bundle, self._is_client = session, endpoint, bundle, is_client
        self._say = say
        self._loop = asyncio.get_running_loop()
        self._said: set[str] = set()
        # The listener exists as long as it is referenced, and this session as long as its process.
        _GUARDS.append(self)
        self._listener = session.info.declare_link_events_listener(direct(self._on_event))

    def check(self) -> None:
        """Check the link that a client has opened.

        Raises:
            BusError: the other side is neither a supervisor nor a router.
        """
        if self._is_client and not all(self._is_hub(link) for link in self._session.info.links()):
            self._session.close()  # pyright: ignore[reportUnknownMemberType]
            raise BusError(f"cannot connect to {self._endpoint}: {tls.NOT_A_HUB}")

    def _is_hub(self, link: zenoh.Link) -> bool:
        return tls.is_hub_name(link.auth_identifier)

    def _on_event(self, event: zenoh.LinkEvent) -> None:
        """Called on Zenoh's thread."""
        link, is_new = event.link, event.kind == zenoh.SampleKind.PUT
        if not link.is_streamed:  # the datagrams of a connection, whose streams are another link
            return
        if not self._is_client:
            change = "connected" if is_new else "disconnected"
            _log.info("%s %s at %s", link.auth_identifier, change, link.dst)
        elif is_new and not self._is_hub(link):
            threading.Thread(target=self._session.close, daemon=True, name="zenoh-refuse").start()  # pyright: ignore[reportUnknownMemberType, reportUnknownArgumentType]
            self._say_once(f"the link to {self._endpoint} is closed: {tls.NOT_A_HUB}")
        if not is_new and time.time() >= self._bundle.ends_s:
            self._say_once(tls.has_ended(self._bundle))

    def _say_once(self, sentence: str) -> None:
        if sentence not in self._said:
            self._said.add(sentence)
            call_in(self._loop, lambda: self._say(sentence))


_GUARDS: list[_Guard] = []


def _try_once(endpoint: str, namespace: str, keys: str) -> None:
    """Connect as a client and close, with Zenoh's log on standard output; nothing else reports the result."""
    config = BusConfig(endpoint, namespace, keys=Path(keys))
    start_log()
    with suppress(zenoh.ZError):
        settings = _settings(config, "client", _bundle(config, "client"), _endpoints(config, "client"))
        zenoh.open(_configuration(config.endpoint, settings)).close()  # pyright: ignore[reportUnknownMemberType]


def start_log() -> None:
    """Write Zenoh's warnings about links to standard output."""
    zenoh.init_log_from_env_or(LOG_FILTER)


def _bundle(config: BusConfig, role: Role) -> Bundle | None:
    """Return the bundle that the endpoint needs; None with tcp.

    Raises:
        BusError: it is missing or refused.
    """
    if not (config.is_hub_secure if role == "hub" else tls.is_secure(config.endpoint)):
        return None
    part = ParticipantRole.SUPERVISOR if role == "hub" else config.part
    return _fitting_bundle(config.keys, config.endpoint, config.namespace, part)


def _fitting_bundle(keys: Path | None, endpoint: str, namespace: str, part: ParticipantRole | None) -> Bundle:
    if keys is None:
        raise BusError(tls.without_keys(endpoint))
    try:
        bundle = choose_bundle(keys, time.time(), part=part)
    except BundleError as error:
        raise BusError(str(error)) from error
    misfit = tls.misfit(bundle, endpoint, namespace, server=part if part in SERVERS else None)
    if misfit is not None:
        raise BusError(misfit)
    return bundle


def _region_name(bundle: Bundle | None) -> str:
    return router.region_name(None if bundle is None else bundle.authority.read_bytes())


def router_settings(config: router.RouterConfig) -> dict[str, object]:
    """Return Zenoh's configuration of a router, and raise the limit of open files of this process for it.

    Raises:
        BusError: its bundle is missing or refused.
    """
    bundle = _router_bundle(config)
    return router.settings(config, bundle, _region_name(bundle), raise_open_files(limits.WANTED_FILES))


def _router_bundle(config: router.RouterConfig) -> Bundle | None:
    secure = [one for one in config.listen if tls.is_secure(one)]
    if not secure and not any(map(tls.is_secure, config.connect)):
        return None
    bundles = [
        _fitting_bundle(config.keys, endpoint, robot, ParticipantRole.ROUTER)
        for endpoint in secure or config.listen
        for robot in config.robots
    ]
    return bundles[0]


def open_router(
    config: router.RouterConfig, settings: dict[str, object], say: Callable[[str], None]
) -> Callable[[], None]:
    """Run a router in this process's threads; return the function that closes it.

    Args:
        config: what the router needs to know.
        settings: of `router_settings`.
        say: called in this event loop with a sentence about a certificate that ends, now or later.

    Raises:
        BusError: it cannot listen.
    """
    os.environ.setdefault("ZENOH_RUNTIME", limits.RUNTIME)
    never_linger()
    listened = " and ".join(config.listen)
    try:
        session = zenoh.open(_configuration(listened, settings))
    except zenoh.ZError as error:
        taken = [one for one in config.listen if f":{tls.port_of(one)}: {IN_USE}" in str(error)]
        if taken:
            sentence = f"another program listens at {taken[0]}: end it, or choose another port with --listen"
            raise BusError(sentence) from error
        raise BusError(_listen_sentence(str(error), listened)) from error
    bundle = _router_bundle(config)
    if bundle is not None:
        if (soon := tls.ends_soon(bundle, time.time())) is not None:
            say(soon)
        _Guard(session, listened, bundle, say, is_client=False)
    return session.close  # pyright: ignore[reportUnknownMemberType, reportUnknownVariableType]


def _endpoints(config: BusConfig, role: Role) -> list[str]:
    """Return where a session listens or connects: the hub at its socket too, and a client of its user there only.

    A client never changes from the socket to TCP: if it reconnected while the hub starts, it would remain a viewer.

    Raises:
        BusError: the socket is the only way to take part, and the hub cannot offer it.
    """
    endpoint = tls.zenoh_endpoint(config.endpoint)
    path = local_socket.socket_of(config.endpoint)
    if path is None:
        return [endpoint]
    own = local_socket.zenoh_endpoint(path)
    if role == "client":
        return [own] if tls.is_loopback(config.endpoint) and local_socket.answers(path) else [endpoint]
    try:
        local_socket.prepare(path)
    except local_socket.SocketError as error:
        if {*config.unproven} < {*LOCAL_ROLES}:
            raise BusError(str(error)) from error
        _log.info("programs take part over TCP only: %s", error)
        return [endpoint]
    return [own, endpoint]


def _is_local(session: zenoh.Session) -> bool:
    """Return whether a client uses the socket of its hub."""
    return all(str(link.dst).startswith(local_socket.PROTOCOL) for link in session.info.links())


def _settings(
    config: BusConfig, role: Role, bundle: Bundle | None, endpoints: list[str]
) -> dict[str, object]:
    """Return Zenoh's configuration for one of the two roles; the values are based on measurements."""
    values: dict[str, object] = {
        "mode": "peer" if role == "hub" else "client",
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        # Zenoh moves payloads of 3 KB and more to shared memory, with silent drops under stalls (zenoh #2628).
        "transport/shared_memory/enabled": False,
        "transport/link/tx/lease": round(config.lease_s * 1000),
        # All samples of one loop iteration are sent in a burst: the default of two places would drop the third sample.
        "transport/link/tx/queue/size/real_time": TX_QUEUE,
    }
    if bundle is not None:
        values["transport/link/tls"] = tls.settings(bundle)
        values["transport/unicast/open_timeout"] = OPEN_LIMIT_MS
    if role == "hub":
        values["listen/endpoints"] = endpoints
        values["access_control"] = access_control(config.namespace, config.contract, config.unproven)
        os.environ.setdefault("ZENOH_RUNTIME", limits.RUNTIME)  # read once, when the first session is opened
        never_linger()
        values |= limits.hub_settings(config.namespace, raise_open_files(limits.WANTED_FILES))
        values["gateway"] = limits.gateway(_region_name(bundle) if config.routers else None)
        if config.routers:
            values |= router.dial(config.routers)
        # The hub answers which session declares what (docs/decisions/0042); it is read-only.
        values["adminspace"] = {"enabled": True, "permissions": {"read": True, "write": False}}
    else:
        values["connect/endpoints"] = endpoints
        if endpoints[0].startswith(local_socket.PROTOCOL):
            values["id"] = local_socket.session_id(os.getpid())
        values["connect/timeout_ms"] = (
            0  # `open_session` retries the first connection itself, and can be cancelled
        )
        # A killed supervisor listens again after some tenths of a second; a longer period would add to that time.
        values["connect/retry"] = {
            "period_init_ms": RECONNECT_MS,
            "period_max_ms": RECONNECT_MS,
            "period_increase_factor": 1,
        }
    return values


def _configuration(endpoint: str, values: dict[str, object]) -> zenoh.Config:
    settings = zenoh.Config()
    for key, value in values.items():
        try:
            settings.insert_json5(key, json.dumps(value))
        except zenoh.ZError as error:
            raise BusError(f"cannot use the endpoint {endpoint!r}: {first_line(error)}") from error
    return settings


def _listen_sentence(reason: str, endpoint: str) -> str:
    if IN_USE in reason or LOCKED in reason:
        return (
            f"the endpoint {endpoint} is already in use: another supervisor may be running "
            "(see `lifeline status`, stop it with `lifeline down`), or choose another with --endpoint"
        )
    return f"cannot listen on the endpoint {endpoint!r}: {first_line(reason)}"


if __name__ == "__main__":
    _try_once(*sys.argv[1:])
