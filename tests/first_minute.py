"""Measure the first minute of a new user: `make first-minute`.

In an empty home directory, with empty caches and without uv: clone this repository, `make run` until the screen says that the
next command moves the robot, quit, and the same again. The port of the default robot must be free.
"""

import asyncio
import os
import shutil
import subprocess
import tempfile
import time
from pathlib import Path

from tests.system.operators import ROOT, Operator, until

LIMIT_S = 600.0
KEPT = ("PIP_", "SSL_", "HTTP", "http", "LANG", "LC_")
"""The beginnings of the variables that the new user has too."""
FULL_SCREEN = "\x1b[?1049h"


async def run(clone: Path, environment: dict[str, str]) -> None:
    """Run `make run` until the robot can be driven, print how long it took and what was printed, and quit."""
    began_s = time.monotonic()
    operator = Operator("env", "-C", str(clone), "make", "run", environment=environment)
    try:
        await until(lambda: operator.keys_count or operator.process.poll() is not None, LIMIT_S)
        took_s = time.monotonic() - began_s
        lines = operator.output.partition(FULL_SCREEN)[0].splitlines()
        operator.type(b"q")
        code, errors = await operator.ended()
    finally:
        operator.close()  # prints the screen
    print(errors, end="")
    print(
        f"drivable after {took_s:.1f} s, exit code {code}, {len(lines)} lines, load {os.getloadavg()[0]:.1f}"
    )


def main() -> None:
    with tempfile.TemporaryDirectory(prefix="lifeline-first-") as directory:
        home = Path(directory)
        path = [one for one in os.environ["PATH"].split(os.pathsep) if shutil.which("uv", path=one) is None]
        environment = {name: value for name, value in os.environ.items() if name.startswith(KEPT)}
        environment |= {"HOME": directory, "PATH": os.pathsep.join(path)}
        began_s = time.monotonic()
        subprocess.run(["git", "clone", "--quiet", str(ROOT), str(home / "lifeline")], check=True)
        print(f"cloned in {time.monotonic() - began_s:.1f} s")
        for _ in range(2):
            asyncio.run(run(home / "lifeline", environment))
        print(subprocess.check_output(["du", "-shc", ".venv", ".uv"], cwd=home / "lifeline", text=True))


if __name__ == "__main__":
    main()
