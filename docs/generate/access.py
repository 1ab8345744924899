"""Write the generated part of docs/access.md.

The part `roles` is the access control as a table, from the grants that the hub applies.
"""

from bench.rig.sheet import markdown_table
from docs.generate import sections
from wire.access import Contract, Message, grants_of
from wire.roles import Role

NAMESPACE = "robot"
SHOWN: tuple[tuple[str, Message], ...] = (
    ("may write", "put"),
    ("may serve", "declare_queryable"),
    ("may call", "query"),
    ("may hold the tokens", "liveliness_token"),
)
CONTRACT = Contract(
    sources=("<source>",), lidars=("<lidar>",), more_keys=("<more_keys>",), stations=("<station>",)
)


def roles_table() -> str:
    rows = ([role, *_cells(role)] for role in Role if role is not Role.SUPERVISOR)
    return markdown_table(["role", *(title for title, _ in SHOWN)], rows)


def _cells(role: Role) -> list[str]:
    keys: dict[Message, dict[str, None]] = {}
    for grant in grants_of(role, NAMESPACE, CONTRACT):
        if grant.flow == "ingress":
            for message in grant.messages:
                keys.setdefault(message, {}).update(
                    {
                        key.removeprefix(f"{NAMESPACE}/"): None
                        for key in grant.keys
                        if key.startswith(NAMESPACE)
                    }
                )
    return [", ".join(f"`{key}`" for key in keys.get(message, {})) or "–" for _, message in SHOWN]


PARTS: sections.Parts = {"roles": roles_table}
