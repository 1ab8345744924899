"""The register of an authority: the certificates that it has issued, and the revoked names (pure).

Zenoh has no revocation list. A certificate that was issued connects until it ends, or until the authority is replaced. The
register therefore keeps every certificate until it has ended, and refuses a new one to a revoked name.
"""

import ipaddress
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from typing import Any, NamedTuple

from wire.host import config
from wire.roles import ANY, LISTENERS, SERVERS, Role, common_name
from wire.tls import SOON_S

NAME = re.compile(r"[a-z0-9][a-z0-9_-]{0,31}")
"""A name is part of a file name and of a subject."""
HOST = re.compile(
    r"(?=.{1,253}$)[A-Za-z0-9]([A-Za-z0-9-]{0,61}[A-Za-z0-9])?(\.[A-Za-z0-9]([A-Za-z0-9-]{0,61}[A-Za-z0-9])?)*"
)
END_OF_DATES_S = 253_402_300_800
"""The year 10000, in seconds since the epoch."""
WITH_HOSTS = (*LISTENERS, Role.OPERATOR)
"""Whose certificates may name hosts: an operator also serves a page to browsers, if this page drives."""
LOOPBACK = ("localhost", "127.0.0.1", "::1")
"""Hosts in the certificate of everything that listens."""


class RefusedError(Exception):
    """A request that the register refuses; the message gives the cause and the remedy."""


@dataclass(frozen=True, slots=True)
class Issued:
    """A certificate that was issued."""

    name: str
    role: Role
    robot: str
    hosts: tuple[str, ...]
    serial: str
    ends_s: float
    """End of its validity, in seconds since the epoch."""

    @property
    def common_name(self) -> str:
        return common_name(self.role, self.robot)


@dataclass(frozen=True, slots=True)
class Register:
    """The certificates of one authority, oldest first, and the revoked names."""

    issued: tuple[Issued, ...] = ()
    revoked: Mapping[str, float] = field(default_factory=dict[str, float])
    """By name, when it was revoked, in seconds since the epoch; these names outlive their authority."""

    def latest(self, name: str) -> Issued | None:
        """Return the newest certificate of a name."""
        return next((one for one in reversed(self.issued) if one.name == name), None)

    def ends_s(self, name: str) -> float:
        """Return when the last certificate of a name ends, in seconds since the epoch; 0.0 without a certificate."""
        return max((one.ends_s for one in self.issued if one.name == name), default=0.0)

    def with_issued(self, issued: Issued) -> "Register":
        return Register((*self.issued, issued), self.revoked)

    def with_revoked(self, name: str, now_s: float) -> "Register":
        """Return the register in which a name is revoked.

        Raises:
            RefusedError: no certificate was issued to this name, or it is revoked already.
        """
        if name in self.revoked:
            raise RefusedError(f"{name} was already revoked on {day(self.revoked[name])}")
        if self.latest(name) is None:
            names = ", ".join(sorted({one.name for one in self.issued})) or "none"
            raise RefusedError(f"no certificate was issued to {name}; names with a certificate: {names}")
        return Register(self.issued, {**self.revoked, name: now_s})

    def without_ended(self, now_s: float) -> "Register":
        """Return the register without the certificates that have ended, but with the newest one of each name."""
        kept = tuple(one for one in self.issued if one.ends_s > now_s or one is self.latest(one.name))
        return Register(kept, self.revoked)


class Request(NamedTuple):
    """What `keys issue` asks for; None: as in the latest certificate of this name, else the default."""

    name: str
    role: Role | None
    robot: str | None
    hosts: tuple[str, ...] | None


def subject_of(register: Register, request: Request) -> tuple[str, Role, str, tuple[str, ...]]:
    """Return the name, the role, the robot and the hosts of the certificate to sign.

    Raises:
        RefusedError: a value is not valid, the name is revoked, or it has a certificate for something else.
    """
    name = request.name
    if NAME.fullmatch(name) is None:
        raise RefusedError(
            f"{name!r} is not a name: use up to 32 small letters, digits, - and _, such as alice or robot7"
        )
    if name in register.revoked:
        raise RefusedError(
            f"{name} was revoked on {day(register.revoked[name])} and gets no new certificate: choose another name"
        )
    before = register.latest(name)
    role = request.role or (before.role if before else None)
    if role is None:
        raise RefusedError(f"{name} has no certificate yet: give --role, one of {', '.join(Role)}")
    robot = request.robot or (before.robot if before else "robot")
    if config.NAME.fullmatch(robot) is None:
        raise RefusedError(
            f"{robot!r} is not a robot's namespace: use small letters, digits and _, or {ANY} for all robots"
        )
    if before is not None and before.common_name != common_name(role, robot):
        raise RefusedError(
            f"{name} is {before.common_name}: choose another name for {common_name(role, robot)}, so that each can be "
            "revoked"
        )
    hosts = request.hosts if request.hosts is not None else before.hosts if before else ()
    if hosts and role not in WITH_HOSTS:
        raise RefusedError(
            f"--host is for the roles {', '.join(WITH_HOSTS)} only, which others connect to; {name} is {role}"
        )
    if not hosts and role not in SERVERS:
        return name, role, robot, ()
    for host in hosts:
        _check_host(host)
    return name, role, robot, tuple(dict.fromkeys((*hosts, *LOOPBACK)))


def _check_host(host: str) -> None:
    try:
        ipaddress.ip_address(host)
    except ValueError:
        if HOST.fullmatch(host) is None:
            raise RefusedError(
                f"{host!r} is not a host: give a name or an address without port, such as robot7 or 192.168.1.7"
            ) from None


class Row(NamedTuple):
    """One name in the table of `keys list`."""

    name: str
    role: str
    robot: str
    hosts: tuple[str, ...]
    days_left: float
    """Of the certificate that ends last; negative after its end."""
    ends: str
    """The end of that certificate, in UTC."""
    revoked: str
    """When the name was revoked, in UTC; empty if it was not."""

    @property
    def ends_soon(self) -> bool:
        return not self.revoked and self.days_left * 86400.0 < SOON_S


def rows(register: Register, now_s: float) -> list[Row]:
    """Return one row for each name with a certificate, in the order of the names."""
    names = sorted({one.name for one in register.issued})
    return [_row(register, name, now_s) for name in names]


def _row(register: Register, name: str, now_s: float) -> Row:
    latest, ends_s = register.latest(name), register.ends_s(name)
    assert latest is not None
    days = (ends_s - now_s) / 86400.0
    revoked = minute(register.revoked[name]) if name in register.revoked else ""
    return Row(name, latest.role, latest.robot, latest.hosts, days, minute(ends_s), revoked)


def warnings(table: Sequence[Row]) -> list[str]:
    """Return a sentence for each certificate that has ended or ends soon."""
    return [
        f"{row.name} {'ended' if row.days_left < 0 else 'ends'} on {row.ends}: issue a new certificate with "
        f"`lifeline keys issue {row.name}`"
        for row in table
        if row.ends_soon
    ]


def to_json(register: Register) -> dict[str, Any]:
    """Return the register as JSON values."""
    return {"issued": [asdict(one) for one in register.issued], "revoked": dict(register.revoked)}


def from_json(document: Any) -> Register:  # noqa: ANN401 - any JSON value
    """Return the register of `to_json`.

    Raises:
        ValueError: it is not one.
    """
    try:
        issued = tuple(
            Issued(
                _matching(NAME, one["name"]),
                Role(one["role"]),
                ANY if one["robot"] == ANY else _matching(config.NAME, one["robot"]),
                tuple(str(host) for host in one["hosts"]),
                str(one["serial"]),
                _time_s(one["ends_s"]),
            )
            for one in document["issued"]
        )
        revoked = document["revoked"].items()
        return Register(issued, {_matching(NAME, name): _time_s(time_s) for name, time_s in revoked})
    except (KeyError, TypeError, AttributeError) as error:
        raise ValueError("not a register") from error


def _matching(pattern: re.Pattern[str], name: str) -> str:
    if pattern.fullmatch(name) is None:
        raise ValueError(f"{name!r:.80} is not a name")
    return name


def _time_s(value: Any) -> float:  # noqa: ANN401 - any JSON value
    if not 0 <= value < END_OF_DATES_S:
        raise ValueError(f"{value} is not a time")
    return float(value)


def day(time_s: float) -> str:
    """Return the day of a time in UTC."""
    return f"{datetime.fromtimestamp(time_s, UTC):%Y-%m-%d}"


def minute(time_s: float) -> str:
    """Return a time to the minute, in UTC."""
    return f"{datetime.fromtimestamp(time_s, UTC):%Y-%m-%d %H:%M} UTC"
