"""Entry point of the command `lifeline`: Ctrl-C ends it without a traceback, even while it imports its modules."""

from typing import NoReturn

from deploy.stack.interrupts import default_until_handled


def main() -> NoReturn:
    """Run the command `lifeline`, and exit with its code."""
    default_until_handled()
    from deploy import cli  # noqa: PLC0415 - takes most of the time until the command begins

    cli.main()
