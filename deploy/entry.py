"""Entry point of the command `lifeline`: Ctrl-C ends it without a traceback, even while it imports its modules."""

import gc

from deploy.stack.interrupts import default_until_handled

default_until_handled()  # before the slow imports, of which `typing` is one

COLLECT_AFTER = 50_000
"""New objects until garbage is collected: Python's own 700 would search what the imports create again and again."""


def main() -> None:
    """Run the command `lifeline`, and exit with its code."""
    gc.set_threshold(COLLECT_AFTER)
    from deploy import cli  # noqa: PLC0415 - takes most of the time until the command begins

    cli.main()
