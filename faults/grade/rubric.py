"""The rubric of an exam: the points and limits of each fault, read strictly from TOML. Pure except for reading the file."""

from pathlib import Path
from typing import Annotated, Any

from deploy.stack.errors import DeployError
from wire.foreign import from_toml, read_text
from wire.host.config import Between, ConfigError, Section, read_sections

DEFAULT = Path(__file__).with_name("rubric.toml")

Points = Annotated[int, Between(0, 1000)]
Seconds = Annotated[float, Between(0.05, 4.0, "in s: a robot is watched for 4 s after a fault")]
Metres = Annotated[float, Between(0.0, 10.0, "in m")]
Speed = Annotated[float, Between(0.0, 2.0, "in m/s")]


class Stopping(Section):
    """A fault after which the robot must stop."""

    points: Points
    standstill_s: Seconds
    distance_m: Metres


class Resuming(Section):
    """A fault after which the robot must not move."""

    points: Points
    distance_m: Metres


class Garbage(Stopping):
    """A fault that the program may survive."""

    faster_m_s: Speed


class Obstacle(Section):
    """An object that appears ahead."""

    points: Points
    ahead_m: Annotated[float, Between(0.3, 2.0, "in m: the aisle ahead of the robot has 4 m")]
    clearance_m: Metres


class Second(Section):
    """A second instance of the program."""

    points: Points
    swing_m_s: Speed


class Exam(Section):
    """What is about the whole exam."""

    pass_percent: Annotated[float, Between(0.0, 100.0, "in percent")]
    drive_m_s: Annotated[float, Between(0.2, 1.0, "in m/s")]


class Rubric(Section):
    """Everything that decides the marks. Each table must be complete: a fault with `points = 0` is not injected."""

    exam: Exam
    killed: Stopping
    stopped: Stopping
    resumed: Resuming
    unplugged: Stopping
    garbage: Garbage
    obstacle: Obstacle
    second: Second


TABLES = {name: field.annotation for name, field in Rubric.model_fields.items() if name != "exam"}


def parse(text: str, name: str) -> Rubric:
    """Return the rubric of a TOML text.

    Args:
        text: the content.
        name: of its file, for people.

    Raises:
        DeployError: the text is not TOML, or a key is missing, unknown or out of bounds; all faults are named.
    """
    try:
        document = from_toml(text)
    except ValueError as error:
        raise DeployError(f"the rubric {name} is not TOML: {error}") from error
    exam = {key: value for key, value in document.items() if key not in TABLES}
    tables: dict[str, Any] = {key: document[key] for key in TABLES if key in document}
    try:
        sections = read_sections({"rubric": {"exam": exam, **tables}}, {"rubric": Rubric})
    except ConfigError as error:
        faults = str(error).partition("\n")[2].replace("rubric.exam.", "").replace("rubric.", "")
        raise DeployError(
            f"the rubric {name} is refused; `lifeline grade --print-rubric` prints a complete one:\n{faults}"
        ) from error
    return sections[Rubric]


def read(path: Path | None) -> Rubric:
    """Return the rubric of a file; None: the default.

    Raises:
        DeployError: the file cannot be read, or the rubric is refused.
    """
    where = path or DEFAULT
    try:
        return parse(read_text(where), str(where))
    except OSError as error:
        raise DeployError(
            f"cannot read the rubric {where}: {error.strerror}; `lifeline grade --print-rubric` prints one"
        ) from error
    except ValueError as error:
        raise DeployError(f"cannot use the rubric {where}: {error}") from error
