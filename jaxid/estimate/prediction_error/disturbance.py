"""Disturbance or sensor? What process noise and sensor noise each contribute, and whether there is process noise at all."""

from collections.abc import Mapping, Sequence
from functools import partial
from math import comb

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.typing import NDArray

from ..._compile import compiled
from ..._distributions import chi_squared_tail
from ..result import NORMAL_95, Disturbance, Estimate
from .cubature import Moments
from .filter import Model, Record, filtered, observe
from .likelihood import Problem, intensities_at, noise_at, parameters_at, unflat
from .scoring import QUIETEST

SIGNIFICANT = 0.05
"""Probability of a likelihood ratio as large by chance, below which process noise is said to be there."""
_AT_LIMIT = 0.5
"""Logarithm of a noise's level above the least that is followed, up to which it is as good as absent."""


@partial(compiled, static_argnames=("names", "model"))
def _shares(names, model: Model, problem: Problem, x: Float[Array, " p"]):
    """Share of the process noise in the variance of one-step predictions and of free simulations, by channel [2, ny]."""
    at = unflat(problem, x)
    p = {**problem.numbers, **dict(zip(names, parameters_at(problem, at.z), strict=True))}
    noise, intensity = noise_at(problem, at.sensor), intensities_at(problem, at.process)

    def one(record: Record, there):
        _, before, _ = filtered(model, p, record._replace(there=there), intensity, noise)

        def seen(x):
            return observe(model.robot, p, x, jnp.zeros(record.inputs.shape[1]))[: noise.shape[0]]

        def shown(moments: Moments):
            slope = jax.jacfwd(seen)(moments.mean)
            return jnp.sum((slope @ moments.covariance) * slope, axis=1)

        process = jax.vmap(shown)(before)
        share = jnp.where(jnp.isfinite(process), process / (process + noise**2), 1.0)
        return jnp.sum(jnp.where(record.there, share, 0.0), axis=0)

    records = problem.records
    count = jnp.maximum(jnp.sum(records.there, axis=(0, 1)), 1)
    both = jnp.stack([records.there, jnp.zeros_like(records.there)])
    found = jax.lax.map(lambda there: jax.vmap(one)(records, there), both)
    return jnp.sum(found, axis=1) / count


def chance(ratio: float, levels: int) -> float:
    """Probability of a likelihood ratio (twice the drop of -log L) this large where none of `levels` noises is there.

    A variance cannot be negative, so half of the time each is estimated as zero: a mixture of chi-squared distributions
    (Self & Liang, J. American Statistical Association 82, 1987).
    """
    if ratio <= 0:
        return 1.0
    return float(sum(comb(levels, k) * 0.5**levels * chi_squared_tail(ratio, k) for k in range(1, levels + 1)))


def _noise(value: float, error: float, unit: str, at_zero: bool) -> Estimate:
    """A noise level whose logarithm has the standard error `error`; its interval is symmetric in the logarithm."""
    if at_zero:
        return Estimate(0.0, float("nan"), (0.0, float("nan")), unit, "at_bound")
    with np.errstate(over="ignore"):
        edges = value * np.exp(np.array([-1.0, 1.0]) * NORMAL_95 * error)
    status = "identified" if error < 1.0 else "not_identifiable"
    return Estimate(float(value), float(value * error), (float(edges[0]), float(edges[1])), unit, status)


def _per_root_second(name: str, unit: str | None) -> str:
    unit = unit or f"[{name}]"
    return f"({unit})/s^0.5" if " " in unit else f"{unit}/s^0.5"


def _sentence(
    ratios: Mapping[str, float],
    total: float,
    p: float,
    simulated: Mapping[str, float],
    levels: int,
    silent: Sequence[str],
) -> str:
    if not np.isfinite(total):
        return "Process noise is present: a simulation without it does not follow these logs at all."
    if p >= SIGNIFICANT:
        return f"No process noise shows (likelihood ratio {total:.3g}, p = {p:.2g}): output error fits as well."
    share = ", ".join(f"{100 * value:.0f} % in {channel}" for channel, value in simulated.items())
    text = (
        f"Process noise is present (likelihood ratio {total:.3g}, {'p < 0.0001' if p < 1e-4 else f'p = {p:.2g}'}); of the "
        f"variance that a free simulation leaves it makes {share}"
    )
    quiet = [name for name, ratio in ratios.items() if chance(ratio, 1) >= SIGNIFICANT]
    if levels > 1 and quiet:
        text += f"; none shows on {', '.join(quiet)}"
    if silent:
        text += (
            f". Beside it no white noise shows in {', '.join(silent)}: slow errors of a sensor or of the model are then taken "
            "for a disturbance, too"
        )
    return f"{text}."


def disturbance(
    names: tuple[str, ...],
    model: Model,
    problem: Problem,
    x: Float[Array, " p"],
    covariance: NDArray[np.float64],
    ratio: float,
    ratios: Mapping[str, float],
) -> Disturbance:
    """What the estimate `x` with `covariance` [p, p] of its coordinates says of disturbance and sensors.

    `ratio` is twice the drop of -log L that all process noise brings, `ratios` what each velocity's own brings.
    """
    n, nv = len(names), len(model.noisy)
    channels, units = model.robot.channels.measured, model.robot.channels.units
    at = unflat(problem, x)
    errors = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    intensity, noise = np.asarray(intensities_at(problem, at.process)), np.asarray(noise_at(problem, at.sensor))
    process = {
        name: _noise(intensity[i], errors[n + i], _per_root_second(name, units.get(name)), bool(intensity[i] == 0))
        for i, name in enumerate(model.noisy)
    }
    shown = [(i, name) for i, name in enumerate(channels) if bool(problem.sensed[i])]
    absent = np.asarray(at.sensor) <= QUIETEST + _AT_LIMIT
    sensor = {name: _noise(noise[i], errors[n + nv + i], units.get(name, ""), bool(absent[i])) for i, name in shown}
    predicted, simulated = np.asarray(_shares(names, model, problem, x))
    p = chance(ratio, nv)
    share = {name: float(simulated[i]) for i, name in shown}
    return Disturbance(
        process=process,
        sensor=sensor,
        share_of_prediction={name: float(predicted[i]) for i, name in shown},
        share_of_simulation=share,
        likelihood_ratio=ratio,
        p_value=p,
        ratio_by_velocity=dict(ratios),
        sentence=_sentence(ratios, ratio, p, share, nv, [name for i, name in shown if absent[i]]),
    )
