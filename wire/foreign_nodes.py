"""Names the ROS 2 nodes on the hub that use the keys of rmw_zenoh, from their liveliness tokens.

Lifeline does not read their topics on the hub: rmw_zenoh adds domain, type and type hash to each key, so a command of such
a node has no effect. Token of a node:

    @ros2_lv/<domain>/<session>/<node id>/<node id>/NN/<enclave>/<namespace>/<name>

where `%` replaces each slash (docs/design.md of github.com/ros2/rmw_zenoh). Pure.
"""

NODE_TOKENS = "@ros2_lv/*/*/*/*/NN/*/*/*"
"""The key expression of the tokens."""

MAX_TOKENS = 256
MAX_NAMES = 8
MAX_NAME_LENGTH = 64
_CHUNKS = NODE_TOKENS.count("/") + 1


class ForeignNodes:
    """The nodes whose tokens exist, at most `MAX_TOKENS`; later ones are ignored."""

    def __init__(self) -> None:
        self._names: dict[str, str] = {}
        """By token."""

    def change(self, token: str, *, alive: bool) -> None:
        """Process a token that appeared or disappeared."""
        name = _name_in(token)
        if not alive:
            self._names.pop(token, None)
        elif name is not None and len(self._names) < MAX_TOKENS:
            self._names[token] = name

    def names(self) -> list[str]:
        """Return up to `MAX_NAMES` names such as "/robot/planner", sorted; a last entry counts the others."""
        names = sorted(set(self._names.values()))
        more = len(names) - MAX_NAMES
        return [*names[:MAX_NAMES], f"and {more} more"] if more > 0 else names


def _name_in(token: str) -> str | None:
    """Return the name of a token's node with its namespace; None if it is not the token of a node."""
    chunks = token.split("/")
    if len(chunks) != _CHUNKS:
        return None
    namespace, name = (chunk.replace("%", "/").strip("/") for chunk in chunks[-2:])
    return f"/{namespace}/{name}".replace("//", "/")[:MAX_NAME_LENGTH]
