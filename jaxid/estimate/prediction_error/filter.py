r"""The continuous-discrete filter of one log: innovations of every sample, given what the samples before it said.

    dx = f(x, u; theta) dt + sum_i q_i e_i dw_i,     y_k = h(x_k, u_k; theta) + r v_k

with independent Wiener processes w_i that accelerate the velocities e_i (`noisy` states) with the intensities q_i (unit of
the velocity per root of a second) and white sensor noise of standard deviation r per channel (Jazwinski, Stochastic
Processes and Filtering Theory, 1970; Kristensen, Madsen & Jorgensen, Automatica 40, 2004). Between samples the moments
go through the rollout's own steps, sticking friction and effects included.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from ...robots.effect import Numbers, State
from ...robots.robot import Robot
from ...simulation.rollout import Integrator, begins_in_motion, commanded, step
from .cubature import Innovations, Moments, carried, measured
from .late_sensors import before_lag, moved, shifted, shown, with_lagged


@dataclass(frozen=True)
class Model:
    """What a compiled filter depends on besides array shapes: hashable and free of numbers."""

    robot: Robot
    integrator: Integrator
    noisy: tuple[str, ...]

    @property
    def noisy_index(self) -> tuple[int, ...]:
        """Places of the `noisy` states among the robot's."""
        return tuple(self.robot.states.index(name) for name in self.noisy)


class Record(NamedTuple):
    """One log as the filter reads it: T samples, and the state's moments at the first of them.

    `floor` are the least variances of the states and of the lagged outputs behind them: what rounding leaves.
    """

    dt: Float[Array, " T"]
    inputs: Float[Array, "T nu"]
    outputs: Float[Array, "T ny"]
    there: Bool[Array, "T ny"]
    start: Moments
    floor: Float[Array, " m"]


def as_state(robot: Robot, vector: Float[Array, " n"]) -> State:
    """The state by name."""
    return {name: vector[i] for i, name in enumerate(robot.states)}


def observe(robot: Robot, p: Numbers, vector: Float[Array, " n"], seen: Float[Array, " nu"]) -> Float[Array, " ny"]:
    """What the sensors show of a state and of the lagged outputs behind it, the effects on measurements included."""
    return shown(robot, p, as_state(robot, vector), vector[len(robot.states) :], seen)


def filter_pass(
    look: Callable[[Float[Array, " n"], Float[Array, " nu"]], Float[Array, " ny"]],
    propagate: Callable[[Moments, Any], tuple[Moments, Any]],
    start: Moments,
    rows: tuple[Any, Float[Array, "T nu"], Float[Array, "T ny"], Bool[Array, "T ny"]],
    noise: Float[Array, " ny"],
):
    """Measure and propagate, sample by sample, from `start`.

    `rows`: what `propagate` takes of every sample, the inputs that sensors may show, the outputs, and where there are
    any. Returns for every sample the moments before and after its measurement, the expected outputs and their slope
    there, its innovations, and whatever `propagate` adds.
    """

    def sample(before: Moments, row):
        onward, seen, y, there = row
        expected, slope = look(before.mean, seen), jax.jacfwd(look)(before.mean, seen)
        after, news = measured(before, expected, slope, y, there, noise)
        ahead, kept = propagate(after, onward)
        return ahead, (before, after, expected, slope, news, kept)

    _, found = jax.lax.scan(sample, start, rows)
    return found


def substeps(integrator: Integrator) -> int:
    """Steps between two samples: those of the rollout, made even."""
    return 2 * -(-integrator.substeps // 2)


def _shares(steps: int) -> tuple[float, ...]:
    """Shares of an interval's process noise before every step and after the last: Simpson's rule, which is exact where
    positions integrate velocities."""
    weights = [1.0, *(4.0 if k % 2 else 2.0 for k in range(1, steps)), 1.0]
    return tuple(weight / (3 * steps) for weight in weights)


def advance(model: Model, p: Numbers, vector: Float[Array, " n"], inputs: Float[Array, " nu"], h) -> Float[Array, " n"]:
    """The state, and the lagged outputs behind it, a step of `h` seconds later."""
    robot = model.robot
    before = as_state(robot, vector)
    after = step(robot, before, tuple(inputs), h, p, model.integrator.friction)
    own, lagged = jnp.stack([after[name] for name in robot.states]), vector[len(robot.states) :]
    if not lagged.shape[0]:
        return own
    first, last = before_lag(robot, p, before, inputs), before_lag(robot, p, after, inputs)
    return jnp.concatenate([own, moved(robot, p, lagged, first, last, h)])


def held_inputs(model: Model, p: Numbers, record: Record) -> Float[Array, "T m nu"]:
    """The inputs of every step between samples, effects on commands and the sensors' delay included."""
    held = begins_in_motion(model.robot, as_state(model.robot, record.start.mean))
    fine = commanded(model.robot, p, record.inputs, record.dt, substeps(model.integrator), held)
    return shifted(model.robot, p, fine, record.dt)


def filtered(
    model: Model, p: Numbers, record: Record, intensity: Float[Array, " nv"], noise: Float[Array, " ny"]
) -> tuple[Innovations, Moments, Moments]:
    """Innovations [T, ny] of one log, and the state's moments before and after every measurement."""
    m = substeps(model.integrator)
    *shares, last = _shares(m)
    at = jnp.array(model.noisy_index, dtype=int)

    def kicked(moments: Moments, share, interval) -> Moments:
        added = jnp.zeros_like(moments.mean).at[at].set(share * interval * intensity**2)
        return Moments(moments.mean, moments.covariance + jnp.diag(added))

    def propagate(moments: Moments, row):
        inputs, interval = row

        def one(moments: Moments, own):
            held, share = own
            before = kicked(moments, share, interval)
            return carried(before, lambda x: advance(model, p, x, held, interval / m), record.floor)[0], None

        moments, _ = jax.lax.scan(one, moments, (inputs, jnp.array(shares)))
        return kicked(moments, last, interval), None

    fine = held_inputs(model, p, record)
    rows = ((fine, record.dt), fine[:, 0], record.outputs, record.there)

    def look(x, seen):
        return observe(model.robot, p, x, seen)[: record.outputs.shape[1]]

    start = with_lagged(model.robot, p, record.start, fine[0, 0], as_state)
    before, after, _, _, news, _ = filter_pass(look, propagate, start, rows, noise)
    return news, before, after
