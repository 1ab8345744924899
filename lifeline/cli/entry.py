"""Entry point of the command `lifeline`: Ctrl-C ends it without a traceback, even while it imports its modules."""

import gc

from deploy.stack.errors import default_until_handled

default_until_handled()  # before the slow imports, of which `typing` is one

COLLECT_AFTER = 50_000
"""Number of new objects that starts a garbage collection. Python's default is 700 to 2,000, by version: the imports would
start many collections, which find no garbage."""


def main() -> None:
    """Run the command `lifeline`, and exit with its code."""
    gc.set_threshold(COLLECT_AFTER)
    from lifeline.cli import app as cli

    cli.main()
