"""The address on which a command serves: parsing, loopback, and the error sentences if it cannot listen."""

import errno
import re

from deploy.stack.errors import DeployError
from wire import tls

MAX_PORT = 65535


def parse_listen(text: str) -> tuple[str, int]:
    """Return the host and the port of `HOST:PORT`; an IPv6 address is in brackets.

    Raises:
        DeployError: the text has another form.
    """
    match = re.fullmatch(r"(\[[0-9a-fA-F:.]+\]|[\w.-]+):([0-9]{1,5})", text, re.ASCII)
    if match is None or int(match[2]) > MAX_PORT:
        raise DeployError(
            f"--listen {text!r} is not an address: use HOST:PORT with a port up to {MAX_PORT}, such as 127.0.0.1:9464"
        )
    return match[1].strip("[]"), int(match[2])


def cannot_listen(
    listen: str, number: int | None, reason: str, choice: str = "--listen HOST:PORT"
) -> DeployError:
    """Return the error that a server cannot listen.

    Args:
        listen: a valid `HOST:PORT`.
        number: the operating system's error number, if it is known.
        reason: its text.
        choice: the option that chooses another address; `HOST` stands for the same host.
    """
    host, port = parse_listen(listen)
    if number == errno.EADDRINUSE:
        choice = choice.replace("HOST", bracketed(host))
        return DeployError(
            f"port {port} on {host} is in use by another program: choose another port with {choice}"
        )
    return DeployError(
        f"cannot listen on {listen} ({reason}): choose an address of this machine with {choice}"
    )


def bracketed(host: str) -> str:
    """Return a host as an URL contains it: an IPv6 address in brackets."""
    return f"[{host}]" if ":" in host else host


def is_loopback(host: str) -> bool:
    """Return whether only programs of this machine can connect to a server on this host."""
    return tls.is_loopback(f"tcp/{bracketed(host)}:0")
