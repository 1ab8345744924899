"""A program that was started with closed standard streams ends with its exit code, like any other."""

import subprocess
import sys

import pytest

SERVICE = """
import os, sys
from wire.host.process import run_process

async def main(stop):
    names = [os.readlink(f"/proc/self/fd/{number}") for number in range(3)]
    print("said to all", names, file=sys.stderr)
    with open("/dev/null") as file:
        return 7 if file.fileno() > 2 else 8

run_process("service", main)
"""
COMMAND = (
    "import sys; from lifeline.cli.app import main; sys.argv = ['lifeline', 'completion', 'bash']; main()"
)


@pytest.mark.parametrize("closed", [">&-", "2>&-", "<&-", "<&- >&- 2>&-"])
@pytest.mark.parametrize(("program", "code"), [(SERVICE, 7), (COMMAND, 0)], ids=["service", "command"])
def test_a_program_without_standard_streams_ends_with_its_code(program: str, code: int, closed: str) -> None:
    done = subprocess.run(
        ["/bin/sh", "-c", f'exec "$0" -c "$1" {closed}', sys.executable, program],
        capture_output=True,
        check=False,
        timeout=60,
    )
    assert done.returncode == code
    assert b"Traceback" not in done.stderr
