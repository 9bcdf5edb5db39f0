"""What every estimator returns: a `Fit`.

Integral least squares and output error return the same kind of object, so that they can be compared, saved, simulated
and started from one another.
"""

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..robots.robot import Robot

Status = Literal["identified", "not_identifiable", "at_bound", "fixed"]
NORMAL_95 = 1.959963984540054
"""Half width of a 95 % interval in standard errors."""


@dataclass(frozen=True)
class Estimate:
    """One number with its uncertainty. `std_error` and `ci95` are NaN where there is none (fixed, not identifiable)."""

    value: float
    std_error: float
    ci95: tuple[float, float]
    unit: str
    status: Status

    @staticmethod
    def of(value: float, std_error: float, unit: str, status: Status = "identified") -> "Estimate":
        """An estimate with its 95 % interval from the standard error."""
        if status == "fixed":
            std_error = float("nan")
        half = NORMAL_95 * std_error
        return Estimate(float(value), float(std_error), (float(value - half), float(value + half)), unit, status)

    def to_dict(self) -> dict[str, Any]:
        """As result files have it."""
        return {
            "value": self.value,
            "std_error": self.std_error,
            "ci95": list(self.ci95),
            "unit": self.unit,
            "status": self.status,
        }


@dataclass(frozen=True)
class Outlier:
    """A stretch of samples that a robust loss gave little weight: from `start` to `stop` [s], `samples` of one channel.

    `deviations`: measured minus simulated at the worst of them, in robust standard deviations.
    """

    log: str
    channel: str
    start: float
    stop: float
    samples: int
    deviations: float


@dataclass(frozen=True)
class Fit:
    """The result of an estimator.

    - `method`: "integral_least_squares", "output_error" …
    - `robot`: the robot with the estimates as its parameters: an ordinary model.
    - `parameters`: every parameter of the table by symbol; `combinations`: what the data determines when single
      parameters are not.
    - `covariance`: of the free parameters `free_names`, in SI units (NaN rows where not identifiable).
    - `noise`: estimated standard deviation of each measured channel's residual.
    - `converged`, `reason` in words, `iterations`.
    - `initial_states`: per log name, the initial state used (estimated where it was free).
    - `notes`: sentences that the user should read.
    - `log_status`: per log name, "fitted" or what is wrong with it: "left out: …", "stands out: …".
    - `clock_offsets`: per log name, how far the inputs' clock is ahead of the outputs' [s], where that was estimated.
    - `outliers`: what a robust loss gave little weight.
    """

    method: str
    robot: Robot
    parameters: dict[str, Estimate]
    combinations: dict[str, Estimate]
    free_names: tuple[str, ...]
    covariance: NDArray[np.float64]
    noise: dict[str, float]
    converged: bool
    reason: str
    iterations: int
    initial_states: dict[str, dict[str, float]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    log_status: dict[str, str] = field(default_factory=dict)
    clock_offsets: dict[str, Estimate] = field(default_factory=dict)
    outliers: tuple[Outlier, ...] = ()

    def __getitem__(self, name: str) -> Estimate:
        """The estimate of a parameter or combination by its symbol."""
        return self.parameters[name] if name in self.parameters else self.combinations[name]
