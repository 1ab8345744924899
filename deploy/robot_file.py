"""A whole robot.toml, with every section checked by itself and against the others."""

from collections.abc import Iterator
from typing import Any

from sim.config import SimSection
from supervisor.config import SupervisorSection
from supervisor.fit import fit_to_base
from supervisor.safety import IMPLAUSIBLE_FACTOR
from teleop.config import TeleopSection
from wire.config import BusSection, Conflict, Section, Sections, read_sections

COMMANDS_IN_TIMEOUT = 1.5
"""With fewer in one command timeout, the robot stops for every command that is a little late."""


def read_robot(document: dict[str, Any], *, simulated: bool) -> Sections:
    """Every section of the document.

    Args:
        document: of `wire.config.read_toml`.
        simulated: whether `[sim]` is the robot, even where the document has no such section.

    Raises:
        ConfigError: naming every faulty key of all sections.
    """
    models: dict[str, type[Section]] = {
        "bus": BusSection,
        "supervisor": SupervisorSection,
        "teleop": TeleopSection,
    }
    if simulated or "sim" in document:
        models["sim"] = SimSection
    return read_sections(document, models, fit_to_base, fit_to_supervisor)


def fit_to_supervisor(sections: Sections) -> Iterator[Conflict]:
    """Every number of `[teleop]` that the supervisor would answer with a stop."""
    config, teleop = sections.get(SupervisorSection), sections.get(TeleopSection)
    if config is None or teleop is None:
        return
    for key in ("max_linear_m_s", "max_angular_rad_s"):
        limit, most = getattr(config, key), getattr(teleop, key)
        if most > IMPLAUSIBLE_FACTOR * limit:
            message = (
                f"is more than {IMPLAUSIBLE_FACTOR:g} times [supervisor] {key} = {limit:g}, which stops the robot as "
                f"COMMAND_INVALID: set at most {limit:g}"
            )
            yield Conflict(("teleop", key), most, message)
    least_s = COMMANDS_IN_TIMEOUT / teleop.rate_hz
    if config.command_timeout_s < least_s:
        message = (
            f"must be at least {COMMANDS_IN_TIMEOUT:g} periods of [teleop] rate_hz = {teleop.rate_hz:g}, or the robot "
            f"stops for every command that is a little late: set {least_s:.4g}, or a higher rate_hz"
        )
        yield Conflict(("supervisor", "command_timeout_s"), config.command_timeout_s, message)
