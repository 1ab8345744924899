"""Entry point of the command `lifeline`: Ctrl-C ends it without a traceback, even while it imports its modules."""

from deploy.stack.interrupts import default_until_handled

default_until_handled()  # before the slow imports, of which `typing` is one


def main() -> None:
    """Run the command `lifeline`, and exit with its code."""
    from deploy import cli  # noqa: PLC0415 - takes most of the time until the command begins

    cli.main()
