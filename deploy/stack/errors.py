"""What the operator can mend: told in one sentence, without a traceback."""

EXIT_REFUSED = 2
EXIT_NOT_RUNNING = 3


class DeployError(Exception):
    """The command cannot be done; the message says why, and what to do."""
