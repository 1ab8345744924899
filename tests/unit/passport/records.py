"""Records of measurements that were not made."""

from passport.cells import NOT_TESTED
from passport.record import Cell, Conditions, Instrument, Passport, Run

UNCERTAINTY_M, UNCERTAINTY_RAD, UNCERTAINTY_S = 0.01, 0.03, 0.02


def run(
    distance_m: float = 0.3, *, v0_m_s: float = 0.8, stop_s: float | None = 0.5, stopped: bool = True
) -> Run:
    """Return a run; without a time, its recorder was cut off."""
    times = (None, None) if stop_s is None else (0.0, 0.01)
    trace = (
        ()
        if stop_s is None
        else ((-0.5, v0_m_s, -0.5 * v0_m_s), (0.0, v0_m_s, 0.0), (stop_s, 0.0, distance_m))
    )
    return Run(
        t0_s=times[0],
        t1_s=times[1],
        t2_s=None if stop_s is None else 0.1,
        t3_s=stop_s if stopped else None,
        v0_m_s=v0_m_s,
        distance_m=distance_m if stopped else None,
        odometry_m=distance_m,
        deceleration_m_s2=None if stop_s is None or not stopped else 1.8,
        slip=False,
        stopped=stopped,
        trace=trace,
    )


def cell(
    fault: str,
    *runs: Run,
    speed_m_s: float = 0.8,
    load_percent: int = 0,
    refused: str | None = None,
    turn: bool = False,
    with_lifeline: bool = True,
) -> Cell:
    return Cell(
        fault=fault,
        speed_m_s=speed_m_s,
        load_percent=load_percent,
        with_lifeline=with_lifeline,
        turn=turn,
        refused=refused,
        runs=runs,
    )


def record(*cells: Cell, robot: str = "robot", version: str = "1") -> Passport:
    return Passport(
        robot=robot,
        version=version,
        commit="abc",
        configuration_sha256="0" * 64,
        date="2026-11-28 16:30 UTC",
        conditions=Conditions(top_speed_m_s=0.8, loads=("0 %: 0 kg",), floor="concrete", machine_load="0.3"),
        instrument=Instrument(
            wall_fit="line",
            uncertainty_m=UNCERTAINTY_M,
            uncertainty_rad=UNCERTAINTY_RAD if any(one.turn for one in cells) else None,
            uncertainty_s=UNCERTAINTY_S,
        ),
        cells=cells,
        not_tested=NOT_TESTED,
    )
