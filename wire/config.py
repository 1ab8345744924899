"""robot.toml: one file for the whole robot, one section for each process, read strictly.

A wrong key, type or number is refused before anything starts, all of them at once, each with its path,
its value and what is allowed. Nothing is switched off by a magic value: `Positive` is finite and above zero.
"""

import ipaddress
import re
import tomllib
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

from wire.zenoh_bus import DEFAULT_ENDPOINT, BusConfig

SECTIONS = ("bus", "supervisor", "teleop", "sim")

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$", max_length=32)]
"""One chunk of a key: a namespace, a node, a command source."""


class ConfigError(Exception):
    """The configuration is refused; the message names every fault in it."""


class Section(BaseModel):
    """A section of robot.toml."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class BusSection(Section):
    """`[bus]`: shared by all processes."""

    endpoint: str = DEFAULT_ENDPOINT
    namespace: Name = "robot"
    lease_s: Positive = 0.4

    @field_validator("endpoint")
    @classmethod
    def _is_an_endpoint(cls, value: str) -> str:
        match = re.fullmatch(r"(tcp|tls|quic)/(\[[0-9a-fA-F:]+\]|[^:/\s]+):(\d{1,5})", value)
        if match is None or not 0 < int(match[3]) < 65536:
            raise ValueError("expected PROTOCOL/HOST:PORT such as tcp/127.0.0.1:7447")
        return value

    def to_bus_config(self) -> BusConfig:
        return BusConfig(self.endpoint, self.namespace, self.lease_s)


def is_loopback(endpoint: str) -> bool:
    """Whether an endpoint stays on this machine."""
    host = endpoint.split("/", 1)[1].rsplit(":", 1)[0].strip("[]")
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


S = TypeVar("S", bound=Section)


def read_toml(path: Path | None) -> dict[str, Any]:
    """The file as a dictionary of sections; no file is an empty one: every key has a default.

    Raises:
        ConfigError: the file is not there, is not TOML, or has a section that nobody reads.
    """
    if path is None:
        return {}
    try:
        document = tomllib.loads(path.read_text())
    except OSError as error:
        raise ConfigError(
            f"cannot read the configuration {path}: {error.strerror}; deploy/robot.toml is a complete example"
        ) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path} is not TOML: {error}") from error
    unknown = [name for name in document if name not in SECTIONS]
    if unknown:
        raise ConfigError(
            f"{path}: unknown section {', '.join(f'[{n}]' for n in unknown)}; "
            f"there are {', '.join(f'[{n}]' for n in SECTIONS)}"
        )
    return document


def section(document: dict[str, Any], name: str, model: type[S]) -> S:
    """One section of the document, checked.

    Raises:
        ConfigError: naming every faulty key with its value and what is allowed.
    """
    try:
        return model.model_validate(document.get(name, {}))
    except ValidationError as error:
        lines = [_sentence(name, dict(fault)) for fault in error.errors(include_url=False)]
        raise ConfigError(
            "the configuration is refused:\n" + "\n".join(f"  {line}" for line in lines)
        ) from error


def _sentence(name: str, fault: dict[str, Any]) -> str:
    path = ".".join([name, *(str(part) for part in fault["loc"])])
    if fault["type"] == "extra_forbidden":
        return f"{path}: there is no such key"
    message = str(fault["msg"]).removeprefix("Value error, ")
    return f"{path} = {fault['input']!r}: {message[0].lower()}{message[1:]}"
