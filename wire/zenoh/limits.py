"""What the hub permits its clients, as far as Zenoh can be configured (pure; docs/attacks.md).

Every connection needs an open file, and so does every file that the supervisor writes: the black box and the e-stop record
must still find a free one when strangers hold all connections that the hub permits.
"""

from wire.inbox import BusError

ACCEPT_TIMEOUT_S = 2.0
"""How long a new connection may take to introduce itself: three round trips on a slow link, with one lost packet."""
MAX_SESSIONS = 1000
MAX_PENDING = 4000
"""Maximum number of connections that have not introduced themselves yet. Beyond it, the hub closes new ones immediately:
within `ACCEPT_TIMEOUT_S`, an attacker must open so many to lock others out."""
RESERVED_FILES = 256
"""Open files of the supervisor itself."""
MIN_SESSIONS = 16
"""For base, command sources, e-stop stations and viewers; a hub that cannot have so many does not start."""
NEEDED_FILES = RESERVED_FILES + 2 * MIN_SESSIONS
WANTED_FILES = MAX_SESSIONS + MAX_PENDING + RESERVED_FILES

MESSAGE_BYTES = (1 << 20) + (1 << 16)
"""Maximum size of a message that arrives in fragments: the largest payload of Lifeline, with its key and attachment."""
BATCH_BYTES = 16 << 10
"""Size of Zenoh's buffers. A session that reads nothing fills up to thirty of them; larger messages are divided."""
COMMAND_BYTES = 1024
"""Maximum size of a command with its attachment; a Twist with its stamp has 85 bytes."""
QUERY_BYTES = 1 << 16

MEMORY_BYTES = 1 << 30
"""Maximum size of the supervisor's writable memory, of which it needs 160 MB, mostly stacks. What Zenoh stores for its
clients has no limit otherwise: fragments of one byte occupy 8 KB each, and key expressions remain until their session ends."""

ACCEPTOR_THREADS = 4
"""Number of Zenoh's threads that accept connections and poll their sockets. With one, as is Zenoh's default, a single
`close` that waits for its peer stops all reading: after one lease, every client loses its link."""
RECEIVING_THREADS = 32
"""Number of Zenoh's threads that receive. Closing a TCP link that does not answer occupies one for up to ten seconds
(SO_LINGER). With two, as is Zenoh's default, two dead clients can stop the commands of all others."""
RUNTIME = f"(acc: (worker_threads: {ACCEPTOR_THREADS}), rx: (worker_threads: {RECEIVING_THREADS}))"
"""Value of Zenoh's environment variable `ZENOH_RUNTIME`."""


def gateway(routers: str | None) -> dict[str, object]:
    """Return which participants are below the hub: all but its own routers.

    By default, Zenoh takes each router for the way to the rest of the network: it passes it every query without a
    declaration, and waits for its answer to each query for tokens, until the time limit. A router below a hub is refused.

    Args:
        routers: the region name by which the hub knows its own routers; None: it has none.
    """
    own = [] if routers is None else [{"region_names": [routers], "negated": True}]
    modes = ["router", "peer", "client"] if routers is None else ["peer", "client"]
    return {"south": [{"filters": [{"modes": modes}, *own]}]}


def hub_settings(namespace: str, open_files: int) -> dict[str, object]:
    """Return the part of Zenoh's configuration that limits the clients of a hub or a router.

    Args:
        namespace: the robot's namespace; `*` for a router.
        open_files: the maximum number of open files of this process.

    Raises:
        BusError: they are too few.
    """
    if open_files < NEEDED_FILES:
        raise BusError(
            f"this process may open {open_files} files, but needs {NEEDED_FILES} for itself and {MIN_SESSIONS} programs: raise its "
            "hard limit of open files (RLIMIT_NOFILE; LimitNOFILE= in a unit of systemd)"
        )
    free = open_files - RESERVED_FILES
    sessions = min(MAX_SESSIONS, free // 2)
    return {
        "transport/unicast/accept_timeout": round(ACCEPT_TIMEOUT_S * 1000),
        "transport/unicast/accept_pending": min(MAX_PENDING, free - sessions),
        "transport/unicast/max_sessions": sessions,
        "transport/link/tx/batch_size": BATCH_BYTES,
        # Zenoh's default is 1 GiB for each session, priority and reliability.
        "transport/link/rx/max_message_size": MESSAGE_BYTES,
        "low_pass_filter": [
            _at_most(COMMAND_BYTES, "commands", ["put", "delete"], f"{namespace}/*/cmd_vel"),
            _at_most(MESSAGE_BYTES, "samples", ["put", "delete"], "**"),
            _at_most(QUERY_BYTES, "queries", ["query", "reply"], "**"),
        ],
    }


def _at_most(size: int, name: str, messages: list[str], key: str) -> dict[str, object]:
    """Return the rule of a low-pass filter that drops larger messages of the clients."""
    return {"id": name, "messages": messages, "flows": ["ingress"], "key_exprs": [key], "size_limit": size}
