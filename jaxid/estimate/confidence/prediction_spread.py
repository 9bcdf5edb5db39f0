"""What a fit's own uncertainty lets one expect of its prediction.

Standard errors are of parameters; what they mean for a motion depends on the motion. Some hang on a hair: a pendulum close
to the top or a caster pushed over its dead point goes one way or the other by less than any log determines. So models are
drawn from the covariance and simulate the held-out logs. A held-out error within what they scatter is no fault of the model;
one above it shows something that the fitted logs did not.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ...logs import LogSet
from ...logs.noise import usual_size
from ...simulation.simulate import simulate_models
from ..result import Fit
from .agreement import errors_of, rms

_DRAWS, _SEED = 24, 0
_WORTH_A_WORD = 1.5
"""Held-out error, in units of the noise, from which it is asked whether the uncertainty explains it."""
_NEWS = 1.2
"""Held-out error over that of a free simulation of the fitted logs up to which these show it as well."""
_FAR_OFF = 20.0
"""Held-out error, in units of the noise, from which a column of another sign or unit is likelier than another floor or load."""
_BEYOND = 0.2
"""Share of the fitted logs' range by which a held-out signal must leave it to be named."""


def expected_error(
    fit: Fit, logs: LogSet, noise: Mapping[str, float], start: Mapping[str, NDArray[np.float64]] | None = None
) -> float:
    """The largest error on `logs` (RMS in units of the `noise`) that models drawn from the covariance of `fit` let expect,
    were the fit itself the truth; NaN where the fit has no covariance. `start` as `simulate` takes it."""
    covariance = np.asarray(fit.covariance)
    if not np.isfinite(covariance).all():
        return float("nan")
    robot, names = fit.robot, list(fit.free_names)
    table = robot.parameters
    centre = np.array([fit[name].value for name in names])
    low, high = (np.array([getattr(table[name], side) for name in names]) for side in ("lower", "upper"))
    drawn = np.random.default_rng(_SEED).multivariate_normal(centre, covariance, _DRAWS, check_valid="ignore")
    drawn = np.clip(drawn, low, high).tolist()
    others = [robot.with_values(**dict(zip(names, values, strict=True))) for values in drawn]
    outputs = simulate_models([robot, *others], logs, start=start)
    worst = 0.0
    for k in range(1, len(others) + 1):
        apart = []
        for log, y in zip(logs, outputs, strict=True):
            here, there = errors_of(log, y[0]), errors_of(log, y[k])
            apart += [(there[c] - here[c]) / noise[c] for c in here]
        worst = max(worst, rms(np.concatenate(apart)) ** 2)
    return float(np.sqrt(1.0 + worst))


def _farther(held_out: LogSet, fitted: LogSet) -> str:
    """The signal that leaves the fitted logs' range most, in a clause; empty where none does."""
    found = (_BEYOND, "")
    signals = {name: (lambda log, name=name: log.input(name)) for name in held_out.channels.inputs}
    signals |= {name: (lambda log, name=name: log.output(name)) for name in held_out.channels.outputs}
    for name, of in signals.items():
        with np.errstate(all="ignore"):
            here, there = (np.concatenate([of(log) for log in logs]) for logs in (held_out, fitted))
        if not (np.isfinite(here).any() and np.isfinite(there).any()):
            continue
        low, high = float(np.nanmin(there)), float(np.nanmax(there))
        least, most = float(np.nanmin(here)), float(np.nanmax(here))
        beyond = max(low - least, most - high) / max(high - low, 1e-300)
        if beyond > found[0]:
            text = f"their {name} goes from {least:.3g} to {most:.3g}, that of the fitted logs from {low:.3g} to {high:.3g}"
            found = (beyond, text)
    return found[1]


def prediction_sentence(
    fit: Fit,
    error: float,
    held_out: LogSet,
    noise: Mapping[str, float],
    fitted: LogSet | None = None,
    start: Mapping[str, NDArray[np.float64]] | None = None,
    residuals: Sequence[NDArray[np.float64]] = (),
    seen: float = 0.0,
) -> str:
    """What the `error` of `fit` on the held-out logs `held_out` (in units of the `noise`) says of it; empty where it is about
    the noise, or the fit is doubted already. `fitted`: the logs that were fitted; `residuals` [samples] of each channel there,
    in units of the noise; `seen`: the error of a free simulation of the fitted logs, in units of theirs."""
    if not error > max(_WORTH_A_WORD, _NEWS * seen) or not fit.trustworthy:
        return ""
    usual = max((usual_size(own) for own in residuals), default=np.inf)
    if usual < _WORTH_A_WORD:
        return (
            f"A few samples make the error on the held-out logs {error:.3g} times the noise: outliers, or something brief that "
            f"the model lacks (a push, a slip). All others it misses by {usual:.3g} times the noise at most."
        )
    expected = expected_error(fit, held_out, noise, start)
    if not np.isfinite(expected):
        return ""
    farther = "" if fitted is None else _farther(held_out, fitted)
    if error <= expected:
        return (
            f"It misses the held-out logs by {error:.3g} times the noise, which its standard errors let expect (up to "
            f"{expected:.3g}): this motion hangs on differences that the fitted logs do not determine"
            + (f"; {farther}." if farther else ".")
        )
    return (
        f"It misses the held-out logs by {error:.3g} times the noise, and its standard errors explain {expected:.3g} at most: "
        "these logs show something that the fitted ones do not, so that its parameters or the model do not hold here"
        + (f" ({farther})." if farther else ".")
        + (" Check their columns first: signs, units, which is which." if error > _FAR_OFF else "")
    )
