"""Is the structure of a held-out error no more than what rounding to a sensor's step makes?

Rounding of a signal that changes slowly stays the same for many samples in a row: a complete model's residual then has
structure that no test of white noise expects (Widrow and Kollár, Quantization Noise, 2008). What it would have is drawn: the
model's own outputs with a little white noise, rounded as the sensor does.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray

from ..._distributions import normal_tail
from ...estimate.rounding import noise_below, shows, step_of
from ...logs import LogSet
from .heldout import HeldOut, structure, whiteness

Array = NDArray[np.float64]
_DRAWS, _SEED = 60, 57


def rounded(logs: LogSet, name: str, state: HeldOut) -> bool:
    """Whether rounding to the sensor's step is to be seen in a channel's residual."""
    return shows(step_of(logs, name), state.noise[name] * state.by_channel[name])


def within_rounding(held_out: LogSet, state: HeldOut) -> HeldOut:
    """`state` of a model on the `held_out` logs, marked as `rounded` where it is no larger than noise, and the channels that
    are rounded have no more structure than rounding makes, the others none."""
    half = state.false_alarm / 2
    if state.adequate or state.diverged or not np.isfinite(state.normalised_rms) or state.p_large < half:
        return state
    names = list(state.by_channel)
    coarse = [i for i, name in enumerate(names) if rounded(held_out, name, state)]
    fine = [i for i in range(len(names)) if i not in coarse]
    if not coarse:
        return state
    if fine and whiteness([r[:, fine] for r in state.residuals]) < half:
        return state
    steps = [step_of(held_out, names[i]) / state.noise[names[i]] for i in coarse]
    errors = [r[:, coarse] for r in state.residuals]
    read = [np.stack([log.output(names[i]) / state.noise[names[i]] for i in coarse], axis=1) for log in held_out]
    model = [y + r for y, r in zip(read, errors, strict=True)]
    below = [noise_below([m[:, c] for m in model], [y[:, c] for y in read], step) for c, step in enumerate(steps)]
    rng, size = np.random.default_rng(_SEED), np.array(below) * steps
    drawn = []
    for _ in range(_DRAWS):
        noisy = [m + size * rng.standard_normal(m.shape) for m in model]
        again = [m - _as_read(n, y, steps) for m, n, y in zip(model, noisy, read, strict=True)]
        drawn.append(np.log(max(structure(again)[0], 1e-300)))
    here = np.log(max(structure(errors)[0], 1e-300))
    likely = normal_tail(float((here - np.mean(drawn)) / np.std(drawn, ddof=1)))
    return replace(state, rounded=bool(likely >= half))


def _as_read(values: Float[Array, "T n"], read: Float[Array, "T n"], steps: list[float]) -> Float[Array, "T n"]:
    """The values rounded to the same multiples of the steps as what was `read`, where anything was."""
    return read + np.round((values - read) / np.array(steps)) * np.array(steps)
