"""What every estimator returns: a `Fit`.

Integral least squares and output error return the same kind of object, so that they can be compared, saved, simulated
and started from one another.
"""

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import pandas as pd
from jaxtyping import Float

from .._origin import Origin
from .._table import html_table, text_table
from ..robots.robot import Robot
from .judgement import Judgement

Status = Literal["identified", "not_identifiable", "at_bound", "fixed"]
StandardErrors = Literal["white", "robust", "scatter"]
NORMAL_95 = 1.959963984540054
"""Half width of a 95 % interval in standard errors."""


@dataclass(frozen=True, repr=False)
class Estimate:
    """One number with its uncertainty. `std_error` and `ci95` are NaN where there is none (fixed, of a failed fit); of a
    parameter that is not identifiable they are too large to tell it, or infinite."""

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

    def __repr__(self) -> str:
        unit = f" {self.unit}" if self.unit else ""
        if self.status == "fixed":
            return f"{self.value:.6g}{unit} (fixed)"
        low, high = self.ci95
        interval = f"95 % {low:.5g} to {high:.5g}, {self.status.replace('_', ' ')}"
        return f"{self.value:.6g} ± {self.std_error:.2g}{unit} ({interval})"

    def to_dict(self) -> dict[str, Any]:
        """As result files have it."""
        return {
            "value": self.value,
            "std_error": self.std_error,
            "ci95": list(self.ci95),
            "unit": self.unit,
            "status": self.status,
        }


def estimate_text(estimate: Estimate) -> str:
    """Value ± standard error, or the value and why it has none."""
    if estimate.status == "identified":
        return f"{estimate.value:.5g} ± {estimate.std_error:.2g}"
    return f"{estimate.value:.5g} ({estimate.status.replace('_', ' ')})"


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


@dataclass(frozen=True, repr=False)
class Disturbance:
    """What prediction error says of the two kinds of noise.

    - `process`: intensity of the noise on every velocity, the deviation that it alone causes within one second.
    - `sensor`: standard deviation of every channel's sensor noise.
    - `share_of_prediction`, `share_of_simulation`: the process noise's share of the variance that a prediction one sample
      ahead, and a free simulation of the fitted logs, leaves in every channel.
    - `likelihood_ratio`: twice the drop of -log L that process noise brings; infinite where no simulation without it
      follows the logs. `p_value`: probability of as much by chance. `ratio_by_velocity`: what each one's own brings.
    - `sentence`: whether there is process noise.
    """

    process: dict[str, Estimate]
    sensor: dict[str, Estimate]
    share_of_prediction: dict[str, float]
    share_of_simulation: dict[str, float]
    likelihood_ratio: float
    p_value: float
    ratio_by_velocity: dict[str, float]
    sentence: str

    def __repr__(self) -> str:
        process = [f"process noise of {name}: {estimate!r}" for name, estimate in self.process.items()]
        sensor = [f"sensor noise of {name}: {estimate!r}" for name, estimate in self.sensor.items()]
        return "\n".join([self.sentence, *process, *sensor])

    def to_dict(self) -> dict[str, Any]:
        """As result files have it."""
        return {
            "process": {name: estimate.to_dict() for name, estimate in self.process.items()},
            "sensor": {name: estimate.to_dict() for name, estimate in self.sensor.items()},
            "share_of_prediction": dict(self.share_of_prediction),
            "share_of_simulation": dict(self.share_of_simulation),
            "likelihood_ratio": self.likelihood_ratio,
            "p_value": self.p_value,
            "ratio_by_velocity": dict(self.ratio_by_velocity),
            "sentence": self.sentence,
        }


_SHOWN = 8
"""Notes that a representation holds; all of them are in `Fit.notes`."""
_KINDS = {
    "white": "standard errors hold for white residuals",
    "robust": "standard errors allow for coloured residuals",
    "scatter": "standard errors come from the scatter of the stretches",
}


@dataclass(frozen=True, repr=False)
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
    - `judgement`: what the residual says about all of this; None where there was nothing to simulate.
    - `cost`: half the sum of squared residuals in units of the noise found, and `start_cost`: that of the start, so weighted.
    - `standard_errors`: what they hold for: "white" residuals, coloured ones ("robust"), or the "scatter" of stretches.
    - `window`: length [s] of the windows in which output error simulated, None for free simulation. `initial_states` are
      then those of the windows (`logs.windows.in_windows`).
    - `disturbance`: process noise beside sensor noise, where the estimator tells them apart (prediction error).
    - `origin`: the function and arguments that gave it, the logs by their hashes, versions (`Origin`).
    """

    method: str
    robot: Robot
    parameters: dict[str, Estimate]
    combinations: dict[str, Estimate]
    free_names: tuple[str, ...]
    covariance: Float[np.ndarray, "n n"]
    noise: dict[str, float]
    converged: bool
    reason: str
    iterations: int
    initial_states: dict[str, dict[str, float]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    log_status: dict[str, str] = field(default_factory=dict)
    clock_offsets: dict[str, Estimate] = field(default_factory=dict)
    outliers: tuple[Outlier, ...] = ()
    judgement: Judgement | None = None
    standard_errors: StandardErrors = "white"
    window: float | None = None
    disturbance: Disturbance | None = None
    cost: float = float("nan")
    start_cost: float = float("nan")
    origin: Origin | None = field(default=None, kw_only=True, compare=False, repr=False)

    @property
    def sound(self) -> bool:
        """Whether the residual raises no doubt of the model."""
        return self.judgement is None or self.judgement.trustworthy

    @property
    def trustworthy(self) -> bool:
        """Whether an identified parameter may be shown without a qualifier: of a minimum, whose residual raises no doubt."""
        return self.converged and self.sound

    @property
    def failed(self) -> bool:
        """Whether the residual says that the model does not follow the logs."""
        return self.judgement is not None and self.judgement.verdict == "failed"

    @property
    def remarks(self) -> tuple[str, ...]:
        """The notes without the judgement's own sentence."""
        return tuple(note for note in self.notes if self.judgement is None or note != self.judgement.sentence)

    def status_of(self, name: str) -> str:
        """An estimate's status in words, with the qualifier that the judgement asks for."""
        status = self[name].status.replace("_", " ")
        if status == "identified" and not self.converged:
            return f"{status}, of no minimum"
        if status != "identified" or self.judgement is None or self.trustworthy:
            return status
        if self.judgement.verdict in ("poor", "failed"):
            return f"{status}, of a poor model"
        return f"{status}, biased by noise" if name in self.judgement.biased else status

    def to_pandas(self) -> pd.DataFrame:
        """A row for every parameter, then combination, by symbol: `value`, `std_error`, `ci95_low` and `ci95_high` (NaN where
        there are none), `unit`, `status` and `meaning`; the status of what is identified is in the words of
        `status_of`: of a poor model, it is not "identified" alone."""
        table, combined = self.robot.parameters, self.robot.combinations
        rows = {}
        for name, e in {**self.parameters, **self.combinations}.items():
            meaning = table[name].meaning if name in table else combined[name][2] if name in combined else ""
            status = self.status_of(name) if e.status == "identified" else e.status
            rows[name] = (e.value, e.std_error, *e.ci95, e.unit, status, meaning)
        columns = ["value", "std_error", "ci95_low", "ci95_high", "unit", "status", "meaning"]
        return pd.DataFrame.from_dict(rows, orient="index", columns=columns).rename_axis("parameter")

    def _rows(self) -> list[tuple[str, str, str, str, str]]:
        rows = [("", "value", "std error", "unit", "status")]
        names = dict.fromkeys([*self.free_names, *self.combinations])
        for name in names:
            e = self[name]
            error = f"{e.std_error:.2g}" if e.std_error == e.std_error else "-"
            rows.append((name, f"{e.value:.5g}", error, e.unit, self.status_of(name)))
        return rows

    def _paragraphs(self) -> tuple[list[str], list[str]]:
        method = self.method.replace("_", " ").capitalize()
        done = "converged" if self.converged else f"not converged ({self.reason})"
        before = [self.judgement.sentence] if self.judgement else []
        before.append(f"{method} of {self.robot.name}: {done}; {_KINDS[self.standard_errors]}.")
        notes = [note for note in self.notes if note not in before]
        more = [f"{len(notes) - _SHOWN} more in notes."] if len(notes) > _SHOWN else []
        return before, notes[:_SHOWN] + more

    def __repr__(self) -> str:
        before, after = self._paragraphs()
        return text_table(self._rows(), before, after)

    def _repr_html_(self) -> str:
        before, after = self._paragraphs()
        return html_table(self._rows(), before, after)

    def __getitem__(self, name: str) -> Estimate:
        """The estimate of a parameter or combination by its symbol; `KeyError` for one that the model does not have."""
        if name not in self.parameters and name not in self.combinations:
            known = ", ".join([*self.parameters, *self.combinations])
            raise KeyError(f"There is no {name!r} in this fit; it has {known}.")
        return self.parameters[name] if name in self.parameters else self.combinations[name]


def checked_fit(given: Any, method: str = "output_error") -> Fit:
    """What a user gives as a fit. Raises `TypeError` for anything else, a robot above all, with the remedy."""
    if not isinstance(given, Fit):
        raise TypeError(
            f"a {type(given).__name__} is no fit; give what an estimator returns, such as jaxid.{method}(robot, logs)."
        )
    return given
