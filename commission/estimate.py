"""A measured value with its uncertainty, from repetitions or from least squares."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

_T_1, _T_2 = 12.706, 4.303
_Z = 1.959964


class Estimate(NamedTuple):
    """A value, the half width of its 95 % interval, and the number of measurements.

    The half width is infinite if the measurements do not determine the value.
    """

    value: float
    u95: float
    n: int

    @property
    def low(self) -> float:
        return self.value - self.u95

    @property
    def high(self) -> float:
        return self.value + self.u95

    def far_from(self, reference: float) -> float:
        """Return the end of the interval that is farther from a reference."""
        return self.low if abs(self.low - reference) > abs(self.high - reference) else self.high

    def with_errors(self, *u95s: float) -> "Estimate":
        """Return the estimate with its 95 % half width increased by those of further, independent errors."""
        return self._replace(u95=math.hypot(self.u95, *u95s))

    @property
    def is_determined(self) -> bool:
        return math.isfinite(self.value) and math.isfinite(self.u95)


UNKNOWN = Estimate(math.nan, math.inf, 0)


def student_95(freedom: int) -> float:
    """Return the two-sided 95 % quantile of Student's t distribution; infinite without a degree of freedom.

    From 3 degrees of freedom on, by the Cornish-Fisher expansion: the error is below 1 %.
    """
    if freedom <= 0:
        return math.inf
    if freedom <= 2:
        return _T_1 if freedom == 1 else _T_2
    z = _Z
    first = (z**3 + z) / (4 * freedom)
    second = (5 * z**5 + 16 * z**3 + 3 * z) / (96 * freedom**2)
    third = (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / (384 * freedom**3)
    return z + first + second + third


def of_repeats(values: Sequence[float]) -> Estimate:
    """Return the mean of independent repetitions; a single one has an infinite uncertainty."""
    n = len(values)
    if n == 0:
        return UNKNOWN
    mean = math.fsum(values) / n
    if n == 1:
        return Estimate(mean, math.inf, 1)
    deviation = math.sqrt(math.fsum((value - mean) ** 2 for value in values) / (n - 1))
    return Estimate(mean, student_95(n - 1) * deviation / math.sqrt(n), n)


class Fit(NamedTuple):
    """The result of least squares."""

    parameters: Floats
    """(p,)."""
    covariance: Floats
    """(p, p); infinite if the rows do not determine the parameters."""
    freedom: int
    """Number of rows less that of parameters."""

    def estimate(self, value: float, gradient: Floats) -> Estimate:
        """Return a function of the parameters, with its linearised uncertainty.

        Args:
            value: the function at the parameters.
            gradient: (p,) its derivative by each parameter.
        """
        n = self.freedom + len(self.parameters)
        if not np.isfinite(self.covariance).all():
            return Estimate(value, math.inf, n)
        variance = float(gradient @ self.covariance @ gradient)
        return Estimate(value, student_95(self.freedom) * math.sqrt(max(0.0, variance)), n)


WORST_CONDITION = 1e10


def least_squares(design: Floats, values: Floats) -> Fit:
    """Fit values (n,) by a design matrix (n, p); the residuals give the noise."""
    n, p = design.shape
    parameters: Floats = np.linalg.lstsq(design, values, rcond=None)[0].astype(np.float64)
    freedom = n - p
    normal = design.T @ design
    if freedom <= 0 or np.linalg.cond(normal) > WORST_CONDITION:
        return Fit(parameters, np.full((p, p), math.inf), max(0, freedom))
    residuals = values - design @ parameters
    return Fit(parameters, np.linalg.inv(normal) * float(residuals @ residuals) / freedom, freedom)
