"""Errors that the operator can correct, reported in one sentence without a traceback."""

EXIT_REFUSED = 2
EXIT_NOT_RUNNING = 3


class DeployError(Exception):
    """The command cannot be executed; the message gives the cause and the remedy."""
