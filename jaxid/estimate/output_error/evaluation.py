"""Simulations and sensitivities at given unknowns, wherever a fit runs.

In machine code (`direct`) or, where that takes XLA, as a compiled program, of a fleet's members as lanes of one.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import jax
import numpy as np
from jaxtyping import Float

from ..._arrays import AnyArray
from ..._compile import compiled
from .direct import sensitivities_now, simulated_now
from .in_turns import simulations
from .laid_out import runs_directly
from .lanes import BY_LOG, Operation, ask
from .problem import Problem, Structure, Unknowns, parameters_at, residual_weights, sensitivities, simulate_all


@partial(compiled, static_argnums=(0, 1))
def _simulate_many(structure: Structure, _: None, problems: Problem, unknowns: Unknowns, others: tuple[()]):
    return jax.vmap(lambda problem, at: simulate_all(structure, problem, at))(problems, unknowns)


@partial(compiled, static_argnums=(0, 1))
def _sensitivities_many(structure: Structure, _: None, problems: Problem, unknowns: Unknowns, others: tuple[()]):
    return jax.vmap(lambda problem, at: sensitivities(structure, problem, at))(problems, unknowns)


_SIMULATE = Operation("simulate", _simulate_many, lambda outputs, logs, samples: outputs[:logs, :samples])
_LINEARISE = Operation(
    "sensitivities", _sensitivities_many, lambda both, logs, samples: tuple(x[:logs, :samples] for x in both)
)


def simulated(structure: Structure, problem: Problem, unknowns: Unknowns) -> Float[AnyArray, "E T ny"]:
    """`problem.simulate_all`."""
    together = None if runs_directly(structure, problem) else ask(_SIMULATE, structure, None, problem, unknowns)
    return simulated_now(structure, problem, unknowns) if together is None else together


def squares_at(structure: Structure, problem: Problem, at: Unknowns) -> Float[np.ndarray, "E ny"]:
    """Every log's and channel's sum of squares of the weighted residual."""
    weight = residual_weights(problem)
    error = np.asarray(simulated(structure, problem, at)) - np.asarray(problem.outputs)
    return np.sum(np.where(weight > 0.0, error * weight, 0.0) ** 2, axis=1)


def cost_at(structure: Structure, problem: Problem, at: Unknowns) -> float:
    """Half the sum of squares, as `problem.cost`, from the simulation that every fit has compiled."""
    y, weights = np.asarray(simulated(structure, problem, at)), residual_weights(problem)
    # A simulation that is not finite is no matter where nothing was measured.
    r = np.where(weights > 0.0, y - np.asarray(problem.outputs), 0.0) * weights
    off = np.asarray(parameters_at(problem, at.z) - problem.prior_mean)
    pull = np.where(np.asarray(problem.free), np.asarray(problem.prior_precision), 0.0) * off**2
    stiff = np.asarray(problem.state_precision) * np.asarray(problem.state_scale) ** 2
    own = np.where(np.asarray(problem.state_free), stiff, 0.0) * np.asarray(at.states) ** 2
    with np.errstate(over="ignore"):
        return 0.5 * float(np.sum(r**2) + np.sum(pull) + np.sum(own))


def costs_at(structure: Structure, problem: Problem, points: Sequence[Unknowns]) -> Float[np.ndarray, " k"]:
    """`problem.cost` at k points, side by side."""
    _, costs = simulations(structure, problem, points[0])
    at = Unknowns(np.stack([np.asarray(p.z) for p in points]), np.stack([np.asarray(p.states) for p in points]))
    with np.errstate(over="ignore", invalid="ignore"):
        found = costs(at)
        return np.asarray(found.own).sum(axis=1) + np.asarray(found.shared)


def simulated_with(
    inputs: Sequence[Float[np.ndarray, "E T nu"]], structure: Structure, problem: Problem, unknowns: Unknowns
) -> Float[np.ndarray, "k E T ny"]:
    """Simulated outputs with each of k other inputs of the logs.

    Side by side where machine code answers at once; a program of XLA's, which has been compiled for so many logs, is run
    again instead.
    """
    if not runs_directly(structure, problem):
        each = (replace(problem, inputs=np.asarray(own)) for own in inputs)
        return np.stack([np.asarray(simulated(structure, one, unknowns)) for one in each])

    def again(leaf: AnyArray) -> AnyArray:
        return np.concatenate([np.asarray(leaf)] * len(inputs))

    fields = {name: jax.tree.map(again, getattr(problem, name)) for name in BY_LOG if name != "inputs"}
    many = replace(problem, inputs=np.concatenate(inputs), **fields)
    outputs = np.asarray(simulated_now(structure, many, unknowns._replace(states=again(unknowns.states))))
    return outputs.reshape(len(inputs), -1, *outputs.shape[1:])


def sensitivities_at(structure: Structure, problem: Problem, unknowns: Unknowns):
    """`problem.sensitivities`."""
    together = None if runs_directly(structure, problem) else ask(_LINEARISE, structure, None, problem, unknowns)
    return sensitivities_now(structure, problem, unknowns) if together is None else together
