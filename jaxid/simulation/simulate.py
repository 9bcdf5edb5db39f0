"""Simulate logs with a model: the same inputs, no measurement fed back.

Steps that suit a robot on one log may be too long for another: a caster that is pushed over its dead point, or a pendulum
close to going over the top, makes much of the integration's own error. So steps are shortened until that changes nothing.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from types import MappingProxyType

import jax
import numpy as np
from jaxtyping import Array, Float
from numpy.typing import NDArray

from .._compile import compiled
from .._float64 import in_float64
from .._renamed import renamed
from ..logs import LogSet
from ..logs.noise import noise_scale
from ..robots.given import given_logs
from ..robots.robot import Robot
from .direct import simulated_directly
from .rollout import Integrator, rollout
from .start import initial_states

_FINER, _MOST = 4, 64
"""Factor by which steps are shortened at a time, and at most."""
_VISIBLE = 0.1
"""Difference that shorter steps make on a log, RMS in units of the noise, from which steps are too long."""
_NEGLIGIBLE = 1e-3
"""The same in units of what is simulated, for logs without noise, or without measurements."""


def integrator_for(robot: Robot, logs: LogSet) -> Integrator:
    """The integrator whose steps suit the coarsest sampled log."""
    return Integrator.suited(robot, max(log.sampling_interval for log in logs))


@partial(compiled, static_argnames=("robot", "integrator"))
def _simulate(robot: Robot, integrator: Integrator, numbers, start, inputs, dt, prescribed):
    """Outputs [K, E, T, ny] of E logs with K sets of `numbers` [K], from initial states [K, E]."""

    def model(p, states):
        return jax.vmap(lambda s, u, d, k: rollout(robot, p, s, u, d, integrator, k))(states, inputs, dt, prescribed)

    return jax.vmap(model)(numbers, start)


@renamed(driven="prescribed")
@in_float64
def simulate(
    robot: Robot,
    logs: LogSet,
    *,
    start: Mapping[str, Float[np.ndarray, " E"]] | None = None,
    integrator: Integrator | None = None,
    prescribed: Mapping[str, Float[Array, "E T"]] = MappingProxyType({}),
) -> list[Float[np.ndarray, "_T ny"]]:
    """Simulated outputs of every log, [samples, channels.measured] each.

    `start` gives initial states per log ([E] by state name); by default they follow from the logs (`initial_states`).
    States in `prescribed` are set to these values at every sample (padded as in `logs.batch()`). Without an `integrator` the
    steps suit the robot, and are shortened, to a 64th at most, until that changes no log by a tenth of its noise.

    >>> import jaxid
    >>> t = [0.1 * k for k in range(101)]
    >>> log = jaxid.Log.from_arrays("push", t, {"u": [1.0] * 101}, {"v": [0.0] * 101}, "axis")
    >>> without_friction = jaxid.Axis().parameters.with_values({"M": 2.0, "Fv": 0.0, "Fc": 0.0})
    >>> (y,) = jaxid.simulate(jaxid.Axis(without_friction), jaxid.LogSet([log]))
    >>> print(f"1 N on 2 kg for 10 s: {y[-1, 0]:.3f} m/s")
    1 N on 2 kg for 10 s: 5.000 m/s
    """
    return [y[0] for y in simulate_models([robot], logs, start=start, integrator=integrator, prescribed=prescribed)]


@in_float64
def simulate_models(
    robots: Sequence[Robot],
    logs: LogSet,
    *,
    start: Mapping[str, Float[np.ndarray, " E"]] | None = None,
    integrator: Integrator | None = None,
    prescribed: Mapping[str, Float[Array, "E T"]] = MappingProxyType({}),
) -> list[Float[np.ndarray, "K _T ny"]]:
    """Simulated outputs of every log by K models that differ in nothing but their numbers, as lanes of one program.

    As `simulate`; the steps of a log are those that suit every model on it.
    """
    for robot in robots:
        logs = given_logs(robot, logs)
    batch = logs.batch()
    given = {name: np.asarray(values, dtype=float) for name, values in (start or {}).items()}
    known = set(given) >= set(robots[0].states)
    each = [given if known else {**initial_states(robot, logs).states, **given} for robot in robots]
    states = {name: np.stack([own[name] for own in each]) for name in each[0]}
    tables = [robot.parameters.numbers for robot in robots]
    numbers = {name: np.array([float(own[name]) for own in tables]) for name in tables[0]}

    def with_steps(integrator: Integrator, some: Sequence[int]) -> list[NDArray[np.float64]]:
        """Of some of the logs."""
        own = {name: values[:, some] for name, values in states.items()}
        known = {name: np.asarray(values)[some] for name, values in prescribed.items()}
        there = np.asarray(batch.inputs)[some], np.asarray(batch.dt)[some], known
        outputs = simulated_directly(robots[0], integrator, numbers, own, *there)
        if outputs is None:
            outputs = np.asarray(_simulate(robots[0].structure, integrator, numbers, own, *there))
        return [outputs[:, k, : len(logs[e])] for k, e in enumerate(some)]

    every = list(range(len(logs)))
    if integrator is not None:
        return with_steps(integrator, every)
    integrator, factor = max((integrator_for(robot, logs) for robot in robots), key=lambda own: own.substeps), 1
    outputs = with_steps(integrator, every)
    noise = np.array(list(noise_scale(logs).values()))
    measured = np.any([np.isfinite(log.outputs).any(axis=0) for log in logs], axis=0)
    level, changing = np.where(measured, noise, 0.0), every
    while factor < _MOST and changing:
        factor *= _FINER
        finer = with_steps(Integrator(integrator.substeps * factor, integrator.friction), changing)
        still = []
        for e, simulated in zip(changing, finer, strict=True):
            if not all(_alike(*pair, level) for pair in zip(outputs[e], simulated, strict=True)):
                outputs[e] = simulated
                still.append(e)
        changing = still
    return outputs


def _alike(one: NDArray[np.float64], other: NDArray[np.float64], noise: NDArray[np.float64]) -> bool:
    """Whether two simulations [T, ny] of a log differ by nothing that its noise [ny] would show."""
    if not (np.isfinite(one).all() and np.isfinite(other).all()):
        return not (np.isfinite(one).all() or np.isfinite(other).all())
    difference = np.sqrt(np.mean((one - other) ** 2, axis=0))
    size = np.sqrt(np.mean(other**2, axis=0))
    return bool(np.all(difference <= np.maximum(_VISIBLE * noise, _NEGLIGIBLE * size)))
