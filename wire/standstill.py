"""The speeds below which a robot counts as standing, the same in every program (pure)."""

STILL_M_S = 0.01
STILL_RAD_S = 0.02


def is_still(linear_m_s: float, angular_rad_s: float) -> bool:
    """Return whether a robot with this velocity stands; false for NaN."""
    return abs(linear_m_s) < STILL_M_S and abs(angular_rad_s) < STILL_RAD_S
