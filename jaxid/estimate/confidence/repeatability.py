"""Do several recordings of one robot give the same parameters? Each alone, all together, and all but each.

A recording is compared with the fit of all the others, which shares no data with it: the difference is judged by both
covariances. A recording that cannot be fitted is named and the others stand.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from ..._distributions import chi_squared_tail
from ..._origin import Origin, with_origin
from ..._table import html_table, text_table
from ...logs import LogError, LogSet
from ...robots.robot import Robot
from ...simulation.rollout import Integrator
from ..output_error.conclude import Covariance
from ..output_error.fleet import fit_fleet
from ..result import Fit, estimate_text

_ALL = ""
"""Name of the fit of all recordings among those of all but one."""
FAR = 5.0
"""Residual in units of the other recordings' from which a recording that the model does not describe is left out."""
SIGNIFICANT = 0.01
"""Share of sets of perfectly repeatable recordings in which one is said to disagree."""


@dataclass(frozen=True, repr=False)
class Repeatability:
    """Fits of a set of recordings and how they agree.

    - `together`: the fit of all recordings that could be fitted; `alone` and `without`: the fit of each and of all but
      each, by log name; `failed`: why a recording could not be fitted, by log name.
    - `p_values`: how likely a difference as large as that between `alone` and `without` is by noise alone (Wald's test over
      all parameters that both identify), by log name. `furthest`: the parameter that differs most, with the difference
      in standard errors.
    """

    together: Fit
    alone: dict[str, Fit]
    without: dict[str, Fit]
    p_values: dict[str, float]
    furthest: dict[str, tuple[str, float]]
    failed: dict[str, str]
    origin: Origin | None = field(default=None, kw_only=True, compare=False, repr=False)

    @property
    def disagreeing(self) -> tuple[str, ...]:
        """Recordings that disagree with the others, worst first; the number of recordings is accounted for (Holm)."""
        ordered = sorted(self.p_values, key=lambda name: self.p_values[name])
        found = []
        for k, name in enumerate(ordered):
            if self.p_values[name] > SIGNIFICANT / (len(ordered) - k):
                break
            found.append(name)
        return tuple(found)

    @property
    def sentence(self) -> str:
        """The answer in words."""
        failed = "".join(f" {name} could not be fitted: {why}." for name, why in self.failed.items())
        if not self.disagreeing:
            return f"All {len(self.p_values)} recordings agree within their uncertainty.{failed}"
        parts = []
        for name in self.disagreeing:
            parameter, errors = self.furthest[name]
            parts.append(f"{name} (most in {parameter}: {errors:+.1f} standard errors, p {self.p_values[name]:.1g})")
        return f"Not all recordings agree: {'; '.join(parts)} against the others.{failed}"

    def to_pandas(self) -> pd.DataFrame:
        """A row for every recording and parameter: `log` (empty for all together), the columns of `Fit.to_pandas`, and
        `p_value` of the recording (NaN where it has none)."""
        frames = []
        for label, fit in [(_ALL, self.together), *self.alone.items()]:
            frame = fit.to_pandas().reset_index()
            frame.insert(0, "log", label)
            frames.append(frame.assign(p_value=self.p_values.get(label, np.nan)))
        return pd.concat(frames, ignore_index=True)

    def _rows(self) -> list[tuple[str, ...]]:
        names = self.together.free_names
        rows = [("", *names, "p")]
        for label, fit in [("together", self.together), *self.alone.items()]:
            p = f"{self.p_values[label]:.2g}" if label in self.p_values else ""
            rows.append((label, *(estimate_text(fit[n]) for n in names), p))
        return rows

    def __repr__(self) -> str:
        return text_table(self._rows(), [self.sentence])

    def _repr_html_(self) -> str:
        return html_table(self._rows(), [self.sentence])


def _difference(one: Fit, other: Fit) -> tuple[float, tuple[str, float]]:
    """p value of Wald's test that two independent fits are of the same parameters, and the one that differs most."""
    shared = [
        n for n in one.free_names if one[n].status == "identified" and n in other.parameters
        and other[n].status == "identified"
    ]  # fmt: skip
    if not shared:
        return 1.0, ("", 0.0)
    at = [one.free_names.index(n) for n in shared]
    elsewhere = [other.free_names.index(n) for n in shared]
    difference = np.array([one[n].value - other[n].value for n in shared])
    covariance = one.covariance[np.ix_(at, at)] + other.covariance[np.ix_(elsewhere, elsewhere)]
    errors = difference / np.sqrt(np.diag(covariance))
    worst = int(np.argmax(np.abs(errors)))
    statistic = float(difference @ np.linalg.pinv(covariance, rcond=1e-12, hermitian=True) @ difference)
    return float(chi_squared_tail(statistic, len(shared))), (shared[worst], float(errors[worst]))


def _not_followed(fits: Mapping[str, Fit]) -> dict[str, str]:
    """Why a recording is none of what the model describes, by its name: its fit failed, or, with a residual that is not
    the sensors', is of another kind or far worse than those of the other recordings."""
    found = {}
    for name, fit in fits.items():
        others = [other for key, other in fits.items() if key != name]
        if fit.judgement is None or fit.judgement.verdict == "sound":
            continue
        if fit.judgement.verdict == "failed":
            found[name] = fit.judgement.sentence
        elif fit.window is not None and sum(other.window is None for other in others) > len(others) / 2:
            found[name] = "the model follows it in windows only, and the others as a whole"
        elif len(others) > 1:
            far = {
                channel: level / float(np.median([other.noise[channel] for other in others if channel in other.noise]))
                for channel, level in fit.noise.items()
                if any(channel in other.noise for other in others)
            }
            worst = max(far, key=lambda channel: far[channel], default="")
            if worst and far[worst] > FAR:
                found[name] = (
                    f"its residual in {worst} is {far[worst]:.2g} times that of the other recordings ({fit.judgement.sentence})"
                )
    return found


@with_origin
def repeatability(
    robot: Robot,
    logs: LogSet,
    *,
    start: Fit | Mapping[str, float] | None = None,
    integrator: Integrator | None = None,
    covariance: Covariance = "robust",
    report: Callable[[str], None] = lambda message: None,
) -> Repeatability:
    """Fit every recording alone, all together and all but each, and say which disagrees.

    `start`, `integrator` and `covariance` are those of `output_error`; the robust covariance is the default here, since
    what the model lacks would otherwise pass for disagreement. Raises `LogError` for fewer than two logs that can be fitted.
    """
    options = {"start": start, "integrator": integrator, "covariance": covariance, "report": report}
    alone = fit_fleet(robot, {log.name: LogSet([log]) for log in logs}, **options)
    doubted = _not_followed(alone.fits)
    sound = [log for log in logs if log.name in alone.fits and log.name not in doubted]
    if len(sound) < 2:
        raise LogError(f"repeatability needs two recordings that can be fitted; there are {len(sound)} of {len(logs)}")
    groups = {log.name: LogSet([other for other in sound if other is not log]) for log in sound}
    found = fit_fleet(robot, {_ALL: LogSet(sound), **groups}, **options)
    differences = {name: _difference(alone.fits[name], found.fits[name]) for name in groups if name in found.fits}
    return Repeatability(
        together=found.fits[_ALL],
        alone=alone.fits,
        without={name: found.fits[name] for name in differences},
        p_values={name: p for name, (p, _) in differences.items()},
        furthest={name: worst for name, (_, worst) in differences.items()},
        failed={**alone.failed, **doubted, **found.failed},
    )
