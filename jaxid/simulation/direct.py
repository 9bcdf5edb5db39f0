"""Simulations in machine code alone: for another number of logs, samples or steps nothing is compiled anew."""

from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ..kernel.call import System, machine_code
from ..kernel.direct import outputs
from ..kernel.groups import grouped, ungrouped
from ..kernel.machine import lanes
from ..kernel.symbolic import Untranslated
from ..robots.robot import Robot
from ..robots.signal_path import overrides
from .friction import DryFriction
from .machine_rollout import system_of
from .rollout import Integrator, step

Array = Any
"""NumPy's, or what can be read as such."""
_TOGETHER = 2_000_000
"""Numbers of the inputs and outputs up to which several simulations of the logs run side by side."""


def machine_model(
    robot: Robot, names: tuple[str, ...], friction: DryFriction, prescribed: tuple[str, ...] = ()
) -> System | None:
    """One integration step and the sensors of `robot`, as functions of the parameters `names`, as a sampled system.

    None where a simulation takes XLA: on another device than a processor, in single precision, for functions that have no
    translation, and with effects on commands or sensors, which act on whole records.
    """
    if jax.default_backend() != "cpu" or jnp.result_type(float) != jnp.float64:
        return None
    if any(overrides(type(effect), stage) for effect in robot.effects for stage in ("command", "measure")):
        return None
    system = system_of(robot.structure, names, step, friction, prescribed)
    try:
        machine_code(system, None)
    except Untranslated:
        return None
    return system


def simulated_directly(
    robot: Robot,
    integrator: Integrator,
    numbers: Mapping[str, Float[Array, " c"]],
    start: Mapping[str, Float[Array, "*#lanes E"]],
    inputs: Float[Array, "E T nu"],
    dt: Float[Array, "E T"],
    prescribed: Mapping[str, Float[Array, "E T"]],
) -> Float[Array, "c E T ny"] | None:
    """Simulated outputs of E logs by c robots that differ in nothing but their `numbers`; None where that takes XLA. Call
    under float64.

    Initial states `start` are every robot's own [c, E], or the same for all [E].
    """
    names = tuple(sorted(numbers))
    system = machine_model(robot, names, integrator.friction, tuple(prescribed))
    if system is None:
        return None
    E, T, U = inputs.shape
    p = np.stack([np.asarray(numbers[name], float) for name in names], axis=1)
    x = np.stack([np.broadcast_to(start[name], (len(p), E)) for name in robot.states], axis=2)
    fixed = np.stack([np.asarray(v) for v in prescribed.values()], axis=-1) if prescribed else np.zeros((E, T, 0))
    shares = np.full((integrator.substeps, lanes()), 1.0 / integrator.substeps)
    several = max(1, min(len(p), _TOGETHER // max(1, E * T * (U + system.outputs))))
    found = []
    for first in range(0, len(p), several):
        some = slice(first, first + several)
        own = grouped(np.repeat(p[some], E, axis=0)), grouped(x[some].reshape(-1, x.shape[-1]))
        u, d, known = (_times(len(p[some]), a) for a in (np.asarray(inputs)[:, :, None, :], dt, fixed))
        y = outputs(system, (shares, *own, u, d, known))
        found.append(ungrouped(y, len(p[some]) * E).reshape(-1, E, T, system.outputs))
    return np.concatenate(found)


def _times(times: int, a: Float[Array, "E ..."]) -> Float[Array, "G ... L"]:
    return grouped(np.tile(np.asarray(a), (times, *[1] * (a.ndim - 1))))
