"""robot.toml: one file for the whole robot, with one section for each process, strictly checked.

A wrong key, type or number is refused before any process starts. The message lists the faults of all sections, each
with its path, its value and the allowed values. No magic value disables a check: every number has bounds
(`Between`). Values that are valid individually are then compared with each other: within a section by its method
`conflicts`, between sections by the functions passed to `read_sections`.
"""

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, Self, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    ValidationError,
    model_validator,
)
from pydantic_core import InitErrorDetails, PydanticCustomError, core_schema

from wire import tls, topics
from wire.access import LOCAL_ROLES
from wire.bus_config import DEFAULT_ENDPOINT, BusConfig
from wire.foreign import from_toml, read_text
from wire.roles import ANY, Role

SECTIONS = ("bus", "supervisor", "teleop", "sim", "ros2", "measured")

Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$", max_length=32)]
"""One chunk of a key: the name of a namespace, a node or a command source."""
NAME = re.compile("[a-z][a-z0-9_]{0,31}")
"""The same, for `fullmatch`."""


class ConfigError(Exception):
    """The configuration is refused; the message lists all faults."""


class Conflict(NamedTuple):
    """A contradiction between values that are valid individually."""

    path: tuple[str | int, ...]
    """Path of the key to change, relative to its section."""
    value: object
    """Value of this key; None if no single value is at fault."""
    message: str
    """The allowed values, and what to do."""


@dataclass(frozen=True, slots=True)
class Between:
    """Inclusive bounds of a number, with advice for the error message; refuses NaN and infinity too.

    The bounds are part of the safety argument: without them, a timeout of `1e9` would disable a watchdog, and a distance
    of `1e-9` would disable the barrier.
    """

    low: float
    high: float
    advice: str = ""

    def __get_pydantic_core_schema__(
        self, source: object, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        return core_schema.no_info_after_validator_function(self._check, handler(source))

    def _check(self, value: float) -> float:
        if self.low <= value <= self.high:  # false for NaN
            return value
        advice = f"; {self.advice}" if self.advice else ""
        message = f"must be from {_text(self.low)} to {_text(self.high)}{advice}"
        raise PydanticCustomError("out_of_bounds", "{message}", {"message": message})


def _text(bound: float) -> str:
    return str(bound) if isinstance(bound, int) else f"{bound:.6g}"


# Quantities of more than one section; all others are next to their keys.
Speed = Annotated[float, Between(0.01, 5.0, "in m/s: a faster robot needs more than a planar lidar")]
TurnRate = Annotated[float, Between(0.01, math.tau, "in rad/s: a full turn each second is the most")]
Acceleration = Annotated[
    float, Between(0.05, 20.0, "in m/s²: wheels have no grip for more than twice gravity")
]
AngularAcceleration = Annotated[float, Between(0.05, 100.0, "in rad/s²")]
Angle = Annotated[float, Between(-math.tau, math.tau, "in rad, not in degrees")]
Distance = Annotated[float, Between(-10.0, 10.0, "in m, not in mm")]
"""A coordinate on the robot; the bounds allow a hull as large as a truck."""
Range = Annotated[float, Between(0.1, 200.0, "in m: no planar lidar of a robot has a longer range")]
Beams = Annotated[int, Between(1, 65_536, "as many as one message carries")]
Seed = Annotated[int, Between(0, 2**32 - 1)]


class Section(BaseModel):
    """A section of robot.toml."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    def conflicts(self) -> Iterator[Conflict]:
        """Yield every contradiction between values that are valid individually."""
        return iter(())

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        faults = [
            InitErrorDetails(
                type=PydanticCustomError("conflict", "{message}", {"message": message}), loc=path, input=value
            )
            for path, value, message in self.conflicts()
        ]
        if faults:
            raise ValidationError.from_exception_data(type(self).__name__, faults)
        return self


def _is_not_taken(name: str) -> str:
    if name in TAKEN_NAMES:
        raise ValueError(
            f"is a node or a topic of the wire; choose a name other than {', '.join(sorted(TAKEN_NAMES))}"
        )
    return name


TAKEN_NAMES = frozenset(
    {topics.ALIVE_PREFIX, topics.SUPERVISOR, topics.SIM, topics.ROS2}
    | {
        first
        for entry in (*topics.TOPICS, *topics.SERVICES)
        if not (first := entry.key.partition("/")[0]).startswith("<")
    }
)
"""The first chunks of the wire's keys, and the nodes: a source or sensor with such a name would shadow them."""

FreeName = Annotated[Name, AfterValidator(_is_not_taken)]
"""A name that shadows no node and no topic: a command source, or a further lidar's topic."""


def _is_an_endpoint(value: str) -> str:
    match = re.fullmatch(r"(tcp|tls|quic)/(\[[0-9a-fA-F:]+\]|[^:/\s]+):(\d{1,5})(\?mixed_rel=[01])?", value)
    if match is None or not 0 < int(match[3]) < 65536 or (match[4] and match[1] != "quic"):
        raise ValueError("expected PROTOCOL/HOST:PORT such as tcp/127.0.0.1:7447 or quic/robot7:7447")
    return value


Endpoint = Annotated[str, AfterValidator(_is_an_endpoint)]
"""Where a Zenoh session connects or listens."""


def is_one_robot(name: str) -> str:
    """Return the namespace of a robot.

    Raises:
        ValueError: the name stands for all robots.
    """
    if name == ANY:
        raise ValueError("stands for all robots in a certificate; choose another name")
    return name


def _absolute(path: str) -> str:
    try:
        return str(absolute(Path(path)))
    except ConfigError as error:
        raise ValueError(str(error)) from error


def _is_another_key(key: str) -> str:
    chunks = key.removesuffix("/**").split("/")
    if (
        len(key) > topics.MAX_LIDAR_TOPIC
        or not all(re.fullmatch(r"[a-zA-Z][a-zA-Z0-9_]*", chunk) for chunk in chunks)
        or chunks[0] in TAKEN_NAMES
        or chunks[-1] in {topics.CMD_VEL.key, "holder"}
    ):
        raise ValueError(
            "must be a key of another topic, relative to the namespace, such as camera/image or camera/**"
        )
    return key


MoreKey = Annotated[str, AfterValidator(_is_another_key)]
"""A key that is not in the table of topics; a last part `**` stands for all keys below."""


class BusSection(Section):
    """`[bus]`: shared by all processes."""

    endpoint: Endpoint = DEFAULT_ENDPOINT
    namespace: Annotated[Name, AfterValidator(is_one_robot)] = "robot"
    keys: Annotated[str, Field(min_length=1), AfterValidator(_absolute)] | None = None
    memory_keeper: bool = True
    without_certificate: Literal["participant", "viewer"] = "viewer"
    """What a program is that has no certificate and does not use the hub's socket (local_socket.py)."""
    hub_user: Annotated[str, Field(pattern=r"^[A-Za-z0-9_][A-Za-z0-9_.-]*$", max_length=32)] | None = None
    """The user who may run the hub on this machine beside the user of each process and root (hub_proof.py)."""
    more_keys: Annotated[list[MoreKey], Field(max_length=32)] = []
    """Keys of other topics that bases, sensors and programs of this machine may write."""
    routers: Annotated[list[Endpoint], Field(max_length=4)] = []
    """Zenoh routers to which the hub connects, so that operators reach a robot behind NAT through them."""
    # Zenoh's own default of 10 s is far too long for a robot; below 0.1 s a busy machine loses links.
    lease_s: Annotated[float, Between(0.1, 2.0)] | None = None
    """How long a silent link counts as alive; None: as its protocol needs (tls.py)."""

    def conflicts(self) -> Iterator[Conflict]:
        if tls.is_secure(self.endpoint) and self.keys is None:
            yield Conflict(("endpoint",), None, tls.without_keys(self.endpoint))
        for number, router in enumerate(self.routers):
            if tls.is_secure(router) and self.keys is None:
                yield Conflict(("routers", number), None, tls.without_keys(router))
            if not tls.is_secure(router) and not tls.is_loopback(router):
                yield Conflict(("routers", number), router, tls.UNPROTECTED_ROUTER)
            elif not tls.is_secure(router) and self.without_certificate == "viewer":
                yield Conflict(("routers", number), router, tls.READING_ROUTER)

    def to_bus_config(self, part: Role | None = None) -> BusConfig:
        unproven = LOCAL_ROLES if self.without_certificate == "participant" else (Role.VIEWER,)
        keys = None if self.keys is None else Path(self.keys)
        routers = tuple(self.routers)
        lease_s = self.lease_s or tls.lease_s((self.endpoint, *routers))
        return BusConfig(
            self.endpoint,
            self.namespace,
            lease_s,
            keys,
            part,
            unproven=unproven,
            routers=routers,
            hub_user=self.hub_user,
        )


def same_endpoint(one: str, other: str) -> bool:
    """Return whether two endpoints cannot both be listened on: the same port, and the same host or both on this machine."""
    is_same_host = tls.host_of(one).lower() == tls.host_of(other).lower()
    return tls.port_of(one) == tls.port_of(other) and (is_same_host or (_is_here(one) and _is_here(other)))


def _is_here(endpoint: str) -> bool:
    return tls.is_loopback(endpoint) or tls.host_of(endpoint) in tls.EVERY_ADDRESS


class BaseSection(Section):
    """The values of `[sim]` for the base and its sensors that other sections must fit.

    If read alone, this model ignores the other keys of `[sim]`.
    """

    model_config = ConfigDict(extra="ignore")

    # The base's own watchdog: one second without a command is 1 m at full speed.
    command_timeout_s: Annotated[float, Between(0.02, 1.0)] = 0.15
    acceleration_m_s2: Acceleration = 1.0
    braking_m_s2: Acceleration = 2.0
    angular_acceleration_rad_s2: AngularAcceleration = 4.0
    angular_braking_rad_s2: AngularAcceleration = 8.0
    # From one sample in 10 s, which is useless, to the rate of the physics steps, 500 Hz.
    scan_hz: Annotated[float, Between(0.1, 500.0)] = 20.0
    odom_hz: Annotated[float, Between(0.1, 500.0)] = 50.0


S = TypeVar("S", bound=Section)


def absolute(path: Path) -> Path:
    """Return the absolute path, with `~` and `~user` replaced.

    Raises:
        ConfigError: there is no such user.
    """
    try:
        return path.expanduser().absolute()
    except RuntimeError as error:
        raise ConfigError(f"{path}: there is no user {path.parts[0]}; give the directory itself") from error


def read_toml(path: Path | None) -> dict[str, Any]:
    """Read the file as a dictionary of sections; None gives an empty dictionary, because every key has a default.

    Raises:
        ConfigError: the file cannot be read, is not TOML, or has an unknown section.
    """
    if path is None:
        return {}
    try:
        document = from_toml(read_text(path))
    except OSError as error:
        raise ConfigError(
            f"cannot read the configuration {path}: {error.strerror}; deploy/robot.toml is a complete example"
        ) from error
    except ValueError as error:  # also of a path that no system accepts
        raise ConfigError(f"{path} is not TOML: {error}") from error
    _locate_keys(document, path)
    unknown = [name for name in document if name not in SECTIONS]
    if unknown:
        raise ConfigError(
            f"{path}: unknown section {', '.join(f'[{n:.40}]' for n in unknown[:8])}; "
            f"there are {', '.join(f'[{n}]' for n in SECTIONS)}"
        )
    return document


def _locate_keys(document: dict[str, Any], path: Path) -> None:
    """Make `[bus] keys` absolute: a relative path in a file begins in the directory of the file."""
    match document.get("bus"):
        case {"keys": str() as keys, **others} if keys and not keys.startswith("~"):
            document["bus"] = {**others, "keys": str(path.resolve().parent / keys)}
        case _:
            pass


class Sections:
    """The sections of one document that are valid individually."""

    def __init__(self, valid: Mapping[str, Section]) -> None:
        self._valid = valid

    def get(self, model: type[S]) -> S | None:
        """Return the section of this model, or of a derived one; None if it was refused or not read."""
        return next((section for section in self._valid.values() if isinstance(section, model)), None)

    def __getitem__(self, model: type[S]) -> S:
        section = self.get(model)
        if section is None:
            raise KeyError(model)
        return section


Fit = Callable[[Sections], Iterable[Conflict]]
"""A function that compares sections with each other; the path of a conflict begins with the section's name."""


def read_sections(document: dict[str, Any], models: Mapping[str, type[Section]], *fits: Fit) -> Sections:
    """Read several sections of the document, and check them individually and against each other.

    Raises:
        ConfigError: lists all faulty keys of these sections with their values and the allowed values.
    """
    valid: dict[str, Section] = {}
    lines: list[str] = []
    for name, model in models.items():
        try:
            valid[name] = model.model_validate(document.get(name, {}))
        except ValidationError as error:
            lines.extend(_sentences(name, [dict(fault) for fault in error.errors(include_url=False)]))
    sections = Sections(valid)
    for fit in fits:
        lines.extend(
            _line(".".join(map(str, path)), value, message) for path, value, message in fit(sections)
        )
    if lines:
        raise ConfigError("the configuration is refused:\n" + "\n".join(f"  {line}" for line in lines))
    return sections


def section(document: dict[str, Any], name: str, model: type[S]) -> S:
    """Read and check one section of the document.

    Raises:
        ConfigError: lists all faulty keys with their values and the allowed values.
    """
    return read_sections(document, {name: model})[model]


MAX_FAULTS = 20
"""Of a section, in a message: a file can have a million."""


def _sentences(name: str, faults: list[dict[str, Any]]) -> Iterator[str]:
    for fault in faults[:MAX_FAULTS]:
        depth = len(fault["loc"])
        within = any(other["loc"][:depth] == fault["loc"] for other in faults if len(other["loc"]) > depth)
        if not (fault["type"] == "too_short" and within):  # pydantic does not count entries that are refused
            yield _sentence(name, fault)
    if len(faults) > MAX_FAULTS:
        yield f"{name}: there are {len(faults) - MAX_FAULTS} more faults"


def _sentence(name: str, fault: dict[str, Any]) -> str:
    path = f"{'.'.join([name, *(str(part) for part in fault['loc'])]):.200}"
    if fault["type"] == "extra_forbidden":
        return f"{path}: there is no such key"
    if fault["type"] == "missing":
        return f"{path}: is missing"
    message = str(fault["msg"]).removeprefix("Value error, ")
    return _line(path, fault["input"], f"{message[0].lower()}{message[1:]}")


def _line(path: str, value: object, message: str) -> str:
    return f"{path}: {message}" if value is None else f"{path} = {value!r:.200}: {message}"
