"""Is what a model leaves no more than what the rounding of its logged inputs makes?

What it would do is drawn: simulations by inputs that the log would show as the same numbers.
"""

from dataclasses import replace

import numpy as np

from ..._distributions import normal_tail
from ...estimate.output_error.estimated_start import estimated_start
from ...estimate.rounded_inputs import as_they_may_have_been, input_step
from ...logs import LogSet
from ...robots.robot import Robot
from ...simulation.simulate import integrator_for, simulate
from ..policy import current_policy
from .heldout import HeldOut, scaled_residuals, structure

_SEEN = 0.02
"""Root mean square, in units of the noise, from which what rounding makes is to be seen in a residual."""
_DRAWS, _SEED = 24, 71


def within_input_rounding(robot: Robot, held_out: LogSet, state: HeldOut) -> HeldOut:
    """`state`, which `robot` leaves on the `held_out` logs, marked as `inputs_rounded` where it is neither larger nor of more
    structure than inputs leave that are rounded to the steps of these.

    Of a gap that matters nobody is told so: commands may be on a grid as they act.
    """
    small = state.normalised_rms < current_policy().coarse_law
    if state.adequate or state.diverged or state.simulated_freely is not None or not small:
        return state
    steps = {name: input_step(held_out, name) for name in held_out.channels.inputs}
    if not any(steps.values()):
        return state
    rng = np.random.default_rng(_SEED)
    moved = [
        replace(log, name=f"{log.name} {k}", inputs=as_they_may_have_been(log.inputs, list(steps.values()), rng))
        for k in range(_DRAWS)
        for log in held_out
    ]
    integrator = integrator_for(robot, held_out)
    start = estimated_start(robot, held_out, state.noise)
    every = {name: np.tile(np.asarray(own), _DRAWS) for name, own in start.items()}
    logged = scaled_residuals(held_out, simulate(robot, held_out, start=start, integrator=integrator), state.noise)
    acted = simulate(robot, LogSet(moved), start=every, integrator=integrator)
    count, drawn = len(held_out), []
    for k in range(_DRAWS):
        own = scaled_residuals(held_out, acted[k * count : (k + 1) * count], state.noise)
        drawn.append([a - b for a, b in zip(own, logged, strict=True)])
    sizes = np.array([np.sqrt(np.nanmean(np.concatenate(own) ** 2)) for own in drawn])
    if not np.mean(sizes) > _SEEN:
        return state
    noisy = [[d + rng.standard_normal(d.shape) for d in own] for own in drawn]
    shapes = np.log([max(structure(own)[0], 1e-300) for own in noisy])
    large = (np.log(state.normalised_rms) - np.mean(np.log1p(sizes**2)) / 2) / np.hypot(
        np.std(np.log1p(sizes**2)) / 2, np.sqrt(state.noise_error**2 + 0.5 / max(state.samples, 1))
    )
    shaped = (np.log(max(structure(state.residuals)[0], 1e-300)) - np.mean(shapes)) / np.std(shapes, ddof=1)
    likely = 2.0 * float(normal_tail(max(large, shaped)))
    return replace(state, inputs_rounded=likely >= state.false_alarm)
