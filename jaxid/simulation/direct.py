"""Simulations in machine code alone: for another number of logs, samples or steps nothing is compiled anew."""

from collections.abc import Mapping
from functools import lru_cache
from typing import Any, NamedTuple

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
from .friction import DryFriction
from .machine_rollout import system_of
from .records import Records, commanded_each, in_motion, measured_each, records_of, without_records
from .rollout import Integrator, by_outputs, step

Array = Any
"""NumPy's, or what can be read as such."""
_MOST_MODELS = 256
_TOGETHER = 2_000_000
"""Numbers of the inputs and outputs up to which several simulations of the logs run side by side."""


class MachineModel(NamedTuple):
    """A robot with parameters of given names as machine code: one integration step and the sensors as a sampled `system` of
    some of them, in `places` among all, and the effects on whole `records` before and after."""

    system: System
    places: tuple[int, ...]
    records: Records


def machine_model(
    robot: Robot, names: tuple[str, ...], friction: DryFriction, prescribed: tuple[str, ...] = ()
) -> MachineModel | None:
    """`robot`, as functions of the parameters `names`, in machine code.

    None where a simulation takes XLA: on another device than a processor, in single precision, and for functions that have
    no translation.
    """
    if jax.default_backend() != "cpu" or jnp.result_type(float) != jnp.float64:
        return None
    model = _model(robot.structure, names, friction, prescribed)
    try:
        machine_code(model.system, None)
    except Untranslated:
        return None
    return model


@lru_cache(_MOST_MODELS)
def _model(robot: Robot, names: tuple[str, ...], friction: DryFriction, prescribed: tuple[str, ...]) -> MachineModel:
    plain = without_records(robot)
    left = tuple(effect.key("") for effect in robot.effects if effect not in plain.effects)
    places = tuple(i for i, name in enumerate(names) if not name.startswith(left))
    system = system_of(plain, tuple(names[i] for i in places), step, friction, prescribed)
    try:
        machine_code(system, None)
    except KeyError:  # an effect in the equations of motion reads a parameter of one that was left out
        places = tuple(range(len(names)))
        system = system_of(plain, names, step, friction, prescribed)
    except Untranslated:
        pass  # `machine_model` says so
    return MachineModel(system, places, records_of(robot, names))


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
    names, n = tuple(sorted(numbers)), integrator.substeps
    model = machine_model(robot, names, integrator.friction, tuple(prescribed))
    if model is None:
        return None
    (E, T, U), (system, places, records) = inputs.shape, model
    every = np.stack([np.asarray(numbers[name], float) for name in names], axis=1)
    first, same = _motions(every, [*places, *(records.commands or ())], start)
    p = every[first]
    x = np.stack([np.broadcast_to(start[name], (len(every), E))[first] for name in robot.states], axis=2)
    fixed = np.stack([np.asarray(v) for v in prescribed.values()], axis=-1) if prescribed else np.zeros((E, T, 0))
    parts = 1 if prescribed else records.parts(n)
    shares = np.full((n // parts, lanes()), parts / n)
    rows, held = records.rows(n), in_motion(robot, x)
    between = max(rows // parts, 1)  # rows of inputs between two outputs
    most = max(1, _TOGETHER // max(1, T * (U * rows + parts * system.outputs)))
    if E > most:  # experiments know nothing of one another
        divided = []
        for begin in range(0, E, most):
            some = slice(begin, begin + most)
            own = {name: np.asarray(v)[..., some] for name, v in start.items()}
            there = inputs[some], dt[some], {name: v[some] for name, v in prescribed.items()}
            divided.append(simulated_directly(robot, integrator, numbers, own, *there))
        return np.concatenate(divided, axis=1)
    several = max(1, min(len(p), most // max(1, E)))
    found = []
    for begin in range(0, len(p), several):
        own_p = p[begin : begin + several]
        own = (
            grouped(np.repeat(own_p[:, places], E, axis=0)),
            grouped(x[begin : begin + several].reshape(-1, x.shape[-1])),
        )
        u = grouped(
            by_outputs(commanded_each(records, own_p, inputs, dt, n, held), parts).reshape(-1, T * parts, between, U)
        )
        d, known = (_times(len(own_p), np.repeat(a, parts, axis=1)) for a in (np.asarray(dt) / parts, fixed))
        y = ungrouped(outputs(system, (shares, *own, u, d, known)), len(own_p) * E)
        found.append(y.reshape(-1, E, T * parts, system.outputs))
    moved = np.concatenate(found)
    return measured_each(records, every, moved if len(moved) == len(every) else moved[same], dt, held)


def _motions(p: np.ndarray, moving: list[int], start: Mapping[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """The first of each set of parameters [c, P] of which the motion is another one, and which of these every set has: those
    alike in what is `moving` the robot, in which what the sensors make of the motion is not."""
    each = np.arange(len(p))
    if any(np.ndim(own) > 1 for own in start.values()) or not moving:
        return each, each
    _, first, same = np.unique(p[:, moving], axis=0, return_index=True, return_inverse=True)
    return (each, each) if len(first) == len(p) else (first, same.reshape(-1))


def _times(times: int, a: Float[Array, "E ..."]) -> Float[Array, "G ... L"]:
    return grouped(np.tile(np.asarray(a), (times, *[1] * (a.ndim - 1))))
