"""Where a robot's files are by default: logs, black boxes and the e-stop record."""

import os
from pathlib import Path

ENVIRONMENT = "LIFELINE_STATE_DIR"
IN_CHECKOUT = ".lifeline"
INSTALLED = "~/.local/state"


def checkout() -> Path | None:
    """Return the repository that Lifeline runs from; None if it is installed elsewhere."""
    root = Path(__file__).resolve().parents[2]
    return root if (root / "pyproject.toml").is_file() else None


def state_directory() -> Path:
    """Return the absolute path of the state directory.

    It is `$LIFELINE_STATE_DIR`, else `.lifeline` in the checkout, else `lifeline` in the user's directory for state
    (`$XDG_STATE_HOME`, by default `~/.local/state`). The working directory has no influence: a supervisor that is
    started in another directory must find the record of a pressed e-stop.

    Raises:
        ConfigError: the path begins with the home of a user that does not exist.
    """
    from wire.host.config import absolute  # noqa: PLC0415 - imports pydantic, which `checkout` does not need

    named = os.environ.get(ENVIRONMENT)
    if named:
        return absolute(Path(named))
    root = checkout()
    if root is not None:
        return root / IN_CHECKOUT
    state_home = Path(os.environ.get("XDG_STATE_HOME", ""))
    # The XDG Base Directory Specification: relative paths are ignored.
    return (state_home if state_home.is_absolute() else absolute(Path(INSTALLED))) / "lifeline"
