"""Predictions some samples ahead: what a model foresees of a log from what has been measured so far.

A free simulation asks how far a model goes without looking; where the motion is disturbed or the plant unstable that says
more of the disturbance than of the model. Between one sample ahead and a free simulation lies every horizon.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.typing import NDArray

from ..._compile import compiled
from ..._float64 import in_float64
from ...logs import LogSet
from ..output_error.setup import start_values
from ..result import Fit, checked_fit
from .filter import Model, advance, filtered, held_inputs, observe
from .likelihood import Problem, intensities_at, noise_at, parameters_at, unflat
from .setup import build


@partial(compiled, static_argnames=("names", "model", "ahead"))
def _ahead(names, model: Model, problem: Problem, x: Float[Array, " p"], ahead: int):
    """Outputs [E, T, ny] foreseen `ahead` samples before; those of the first samples from the start."""
    at = unflat(problem, x)
    p = {**problem.numbers, **dict(zip(names, parameters_at(problem, at.z), strict=True))}
    intensity, noise = intensities_at(problem, at.process), noise_at(problem, at.sensor)

    def one(record):
        _, before, after = filtered(model, p, record, intensity, noise)
        fine = held_inputs(model, p, record)
        last, steps = record.dt.shape[0] - 1, fine.shape[1]

        def further(states, k):
            def move(state, number):
                interval, inputs = record.dt[number] / steps, fine[number]
                return jax.lax.scan(lambda s, u: (advance(model, p, s, u, interval), None), state, inputs)[0]

            return jax.vmap(move)(states, jnp.minimum(jnp.arange(last + 1) + k, last)), None

        states, _ = jax.lax.scan(further, after.mean, jnp.arange(ahead))
        # Sample k + ahead is foreseen at k; the first ones from the first sample, before it was measured.
        foreseen = jnp.roll(states, ahead, axis=0)
        early = jnp.arange(last + 1) < ahead
        states = jnp.where(early[:, None], before.mean, foreseen)
        return jax.vmap(lambda s, u: observe(model.robot, p, s, u))(states, fine[:, 0])

    return jax.vmap(one)(problem.records)


@in_float64
def predict(fit: Fit, logs: LogSet, ahead: int = 1, noisy: Sequence[str] | None = None) -> list[NDArray[np.float64]]:
    """Outputs of every log [samples, channels.measured] as `fit` foresees them `ahead` samples before.

    The filter has the fit's process and sensor noise; a fit without process noise sees nothing of the measurements, so
    that its prediction is its free simulation. `noisy` are the states with process noise (default: those of the fit).
    The first `ahead` samples are predicted one sample ahead. Raises `ValueError` for `ahead` below 1.
    """
    if ahead < 1:
        raise ValueError(f"A prediction {ahead} samples ahead foresees nothing; give 1 or more.")
    told = checked_fit(fit, "prediction_error").disturbance
    noisy = tuple(told.process) if noisy is None and told is not None else noisy
    task = build(fit.robot, logs, start=start_values(fit.robot, fit), process_noise=noisy)
    intensity = [told.process[name].value if told else 0.0 for name in task.model.noisy]
    channels = logs.channels.measured
    noise = [fit.noise.get(c, float(task.problem.sensor_reference[i])) for i, c in enumerate(channels)]
    problem = replace(
        task.problem,
        held=jnp.array([fit.robot.parameters[name].value for name in task.names]),
        free=jnp.zeros(len(task.names), dtype=bool),
        process_reference=jnp.array(intensity),
        disturbed=jnp.ones(len(intensity), dtype=bool),
        sensor_reference=jnp.array(noise),
    )
    x = jnp.zeros(len(task.names) + len(intensity) + len(noise))
    outputs = np.asarray(_ahead(task.names, task.model, problem, x, ahead))
    return [outputs[e, : len(log)] for e, log in enumerate(logs)]
