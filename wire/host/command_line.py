"""Shared parts of the three processes' command lines: options, logging, and refusal with a message."""

import argparse
import logging
import os
import sys
from pathlib import Path
from typing import Any, NoReturn

from wire.bus_config import DEFAULT_ENDPOINT, BusConfig
from wire.host.config import read_toml
from wire.host.installation import runnable
from wire.text import printable_lines

EXIT_USAGE = 2
PROGRAM = "LIFELINE_PROGRAM"
"""The environment variable with the command by which a process was started, for its help."""


def service_parser(node: str, **options: Any) -> argparse.ArgumentParser:  # noqa: ANN401 - ArgumentParser's own
    """Return the parser of `python -m <node>`, with `--config` and `--endpoint`."""
    parser = argparse.ArgumentParser(prog=os.environ.get(PROGRAM, f"python -m {node}"), **options)
    parser.add_argument(
        "--config",
        type=Path,
        metavar="FILE",
        help="the configuration, such as robot.toml (default: built-in values)",
    )
    parser.add_argument(
        "--endpoint",
        metavar="tcp/HOST:PORT",
        help=f"address on which the supervisor listens (default: {DEFAULT_ENDPOINT}); quic/HOST:PORT and tls/HOST:PORT need "
        "--keys",
    )
    parser.add_argument(
        "--keys",
        metavar="DIR",
        help="bundle of this computer's certificate and key, made by `lifeline keys issue`",
    )
    parser.add_argument(
        "--namespace",
        metavar="NAME",
        help="namespace of the robot, such as robot7 behind a router (default: robot)",
    )
    return parser


def read_document(arguments: argparse.Namespace) -> dict[str, Any]:
    """Read the configuration file of a command line; its `--endpoint`, `--keys` and `--namespace` replace the file's.

    Raises:
        ConfigError: the file cannot be read.
    """
    document = read_toml(arguments.config)
    for key in ("endpoint", "keys", "namespace"):
        override(document, "bus", key, getattr(arguments, key))
    return document


def bus_options(bus: BusConfig) -> list[str]:
    """Return the options that lead a process to the same endpoint with the same keys."""
    keys = [] if bus.keys is None else ["--keys", str(bus.keys)]
    return ["--endpoint", bus.endpoint, *keys]


def override(document: dict[str, Any], section: str, key: str, value: str | None) -> None:
    """Replace a value of the file by the command line's; a section that is not a table is refused later."""
    values = document.setdefault(section, {})
    if value is not None and isinstance(values, dict):
        values[key] = value


class _Printable(logging.Formatter):
    """Makes foreign text in a log line, such as the name of a file, printable."""

    def format(self, record: logging.LogRecord) -> str:
        return printable_lines(super().format(record))


def log_to_stderr() -> None:
    handler = logging.StreamHandler()
    handler.setFormatter(_Printable("%(asctime)s %(levelname)s %(name)s: %(message)s"))
    logging.basicConfig(level=logging.INFO, handlers=[handler])


def refuse(node: str, sentence: object) -> NoReturn:
    """Print one sentence to stderr and exit, before anything has started."""
    print(f"{node}: {printable_lines(runnable(str(sentence)))}", file=sys.stderr)
    sys.exit(EXIT_USAGE)
