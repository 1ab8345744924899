"""`lifeline router` as a process."""

import subprocess
import sys
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from pathlib import Path

LIMIT_S = 30.0
LIFELINE = str(Path(sys.executable).with_name("lifeline"))


def start_router(
    endpoint: str,
    robots: Sequence[str],
    keys: Path | None,
    *,
    connect: Sequence[str] = (),
    stations: Sequence[str] = (),
    prefix: Sequence[str] = (),
) -> "subprocess.Popen[str]":
    """Start a router, and return its process when it routes."""
    words = [f"--robot={robot}" for robot in robots] + [f"--connect={other}" for other in connect]
    words += [f"--station={station}" for station in stations]
    words += [] if keys is None else ["--keys", str(keys)]
    process = subprocess.Popen(
        [*prefix, LIFELINE, "router", "--listen", endpoint, *words], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    said = ""
    while "routing for" not in said:
        line = process.stdout.readline()
        assert line, f"the router has ended: {said}"
        said += line
    return process


@contextmanager
def router(
    endpoint: str, robots: Sequence[str], keys: Path | None, *, stations: Sequence[str] = ()
) -> "Generator[subprocess.Popen[str]]":
    """Run a router while the context is open."""
    process = start_router(endpoint, robots, keys, stations=stations)
    try:
        yield process
    finally:
        end(process)


def end(process: "subprocess.Popen[str]") -> None:
    process.kill()
    process.communicate(timeout=LIMIT_S)
