"""The record of one measurement: conditions, instrument, and each run of each cell, with its JSON form."""

from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from wire.foreign import ForeignError

FORMAT = 1
"""The version of the format; a record of another version is refused. It increases with every incompatible change."""
MAX_BYTES = 32 << 20
"""Of the JSON text."""
MAX_CELLS, MAX_RUNS, MAX_SAMPLES = 64, 1000, 400
"""Of a record, of a cell, and of a trace."""
MAX_DEVIATIONS = 1000
"""Of a record; the newest are kept."""
MAX_TEXT, MAX_SENTENCE = 300, 1000
"""Characters."""

WITHOUT = "without Lifeline"

Text = Annotated[str, Field(max_length=MAX_TEXT)]
Sentence = Annotated[str, Field(min_length=1, max_length=MAX_SENTENCE)]
Seconds = Annotated[float, Field(ge=-60.0, le=600.0, allow_inf_nan=False)]
"""Time from the fault."""
Metres = Annotated[float, Field(ge=-200.0, le=200.0, allow_inf_nan=False)]
Speed = Annotated[float, Field(ge=-20.0, le=20.0, allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0.0, le=20.0, allow_inf_nan=False)]
Uncertainty = Annotated[float, Field(ge=0.0, le=1.0, allow_inf_nan=False)]


class _Record(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class Run(_Record):
    """One stop. Times count from the fault; a time is None if it could not be observed. For a turn, each m means rad."""

    t0_s: Annotated[float, Field(ge=0.0, le=0.0)] | None
    """The fault; None if the recorder could not see when it began."""
    t1_s: Seconds | None
    """The first zero on cmd_vel that lasted."""
    t2_s: Seconds | None
    """The speed fell below 0.95 of `v0_m_s`."""
    t3_s: Seconds | None
    """Standstill: the speed remained below 0.01 m/s for 0.2 s."""
    v0_m_s: Positive
    """Speed at the fault; the commanded one of a run that did not stop."""
    distance_m: Metres | None
    """From the fault to the standstill, by the lidar; None if it was not seen."""
    odometry_m: Metres | None
    """The same by odometry."""
    deceleration_m_s2: Annotated[float, Field(gt=0.0, le=1000.0, allow_inf_nan=False)] | None
    """Mean from t2 to t3."""
    slip: bool
    """Whether lidar and odometry disagree by more than 2 cm or 5 %."""
    stopped: bool
    trace: Annotated[tuple[tuple[Seconds, Speed, Metres], ...], Field(max_length=MAX_SAMPLES)] = ()
    """(time from the fault [s], speed by odometry [m/s], distance from the fault [m]), in order of time."""

    @model_validator(mode="after")
    def _is_complete(self) -> Self:
        if self.stopped and self.distance_m is None:
            raise ValueError("a run that stopped has a distance_m")
        if self.t0_s is None and (self.t1_s, self.t2_s, self.t3_s) != (None, None, None):
            raise ValueError("without t0_s there are no other times")
        times = [sample[0] for sample in self.trace]
        if times != sorted(times):
            raise ValueError("the trace is not in order of time")
        return self


class Cell(_Record):
    """Runs under the same condition."""

    fault: Sentence
    """In words, such as "operator's program killed"."""
    speed_m_s: Positive
    """The commanded speed at the fault."""
    load_percent: Annotated[int, Field(ge=0, le=200)]
    with_lifeline: bool
    turn: bool = Field(default=False, exclude_if=lambda turn: not turn)
    """Whether it is a turn on the spot. Then each m of the cell and of its runs means rad."""
    refused: Sentence | None = None
    """Why the cell was not measured, or was ended early."""
    runs: Annotated[tuple[Run, ...], Field(max_length=MAX_RUNS)] = ()

    @property
    def name(self) -> str:
        """The fault, and whether Lifeline was not there."""
        return self.fault if self.with_lifeline else f"{self.fault}, {WITHOUT}"

    @property
    def speed(self) -> str:
        """The speed with its unit."""
        return speed_in_words(self.speed_m_s, turn=self.turn)


def speed_in_words(speed: float, *, turn: bool) -> str:
    """Return a speed with its unit."""
    return f"{speed:g} {'rad/s' if turn else 'm/s'}"


def way_in_words(run: Run, *, turn: bool) -> str:
    """Return the distance or angle of a stop, and the speed before it, with units."""
    moved = run.distance_m or 0.0
    if turn:
        return f"{moved:.3f} rad from {run.v0_m_s:.2f} rad/s"
    return f"{100 * moved:.1f} cm from {run.v0_m_s:.2f} m/s"


class Conditions(_Record):
    """What held during the whole measurement."""

    top_speed_m_s: Positive
    loads: Annotated[tuple[Text, ...], Field(max_length=8)]
    """As typed by the person, such as "100 %: 20 kg"."""
    floor: Text
    machine_load: Text
    """Load averages of the computer that measured."""


class Instrument(_Record):
    """How distance and time were measured."""

    wall_fit: Text
    uncertainty_m: Uncertainty
    """Half width of the 95 % interval of one distance."""
    uncertainty_rad: Uncertainty | None = Field(default=None, exclude_if=lambda value: value is None)
    """The same for the angle of a turn [rad]; None in records without turns."""
    uncertainty_s: Uncertainty
    """The largest error of one time."""


class Passport(_Record):
    """One measurement of one robot."""

    format: Literal[1] = FORMAT
    robot: Text
    version: Text
    """Of Lifeline."""
    commit: Text
    """Empty if unknown."""
    configuration_sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
    date: Text
    """Of the first run, such as "2026-11-28 16:30 UTC"."""
    conditions: Conditions
    instrument: Instrument
    cells: Annotated[tuple[Cell, ...], Field(max_length=MAX_CELLS)] = ()
    not_tested: Annotated[tuple[Sentence, ...], Field(max_length=64)] = ()
    deviations: Annotated[tuple[Sentence, ...], Field(max_length=MAX_DEVIATIONS)] = ()

    @model_validator(mode="after")
    def _has_the_instrument(self) -> Self:
        if self.instrument.uncertainty_rad is None and any(cell.turn for cell in self.cells):
            raise ValueError("a turn needs uncertainty_rad")
        return self

    def to_json(self) -> str:
        """Return the JSON text; equal records have equal texts."""
        return self.model_dump_json() + "\n"


def from_json(text: str) -> Passport:
    """Return the record of a JSON text.

    Raises:
        ForeignError: the text is no such record; the message is one sentence.
    """
    if len(text) > MAX_BYTES:
        raise ForeignError(f"it is larger than {MAX_BYTES >> 20} MiB")
    try:
        return Passport.model_validate_json(text)
    except ValidationError as error:
        fault = error.errors(include_url=False)[0]
        where = ".".join(str(part) for part in fault["loc"]) or "the text"
        raise ForeignError(
            f"not a passport of format {FORMAT}: {where:.60}: {fault['msg'].lower():.200}"
        ) from error
