"""Rollouts in machine code, for the models and on the devices that allow it."""

import warnings
from collections.abc import Callable, Mapping
from functools import lru_cache

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..kernel.call import System, rollout
from ..kernel.identity import identity_of
from ..kernel.symbolic import Untranslated
from ..robots.effect import Numbers, Scalars, State
from ..robots.robot import Robot
from .friction import DryFriction

_MOST_MODELS = 256
Step = Callable[[Robot, State, Scalars, Float[Array, ""], Numbers, DryFriction], State]


class SlowSimulation(UserWarning):
    """A model whose functions have no translation to machine code is simulated by XLA, several times slower."""


@lru_cache(_MOST_MODELS)
def system_of(
    robot: Robot, names: tuple[str, ...], step: Step, friction: DryFriction, fixed: tuple[str, ...]
) -> System:
    """The robot's integration step and sensors as functions of the parameters `names`; states `fixed` are set at every
    sample."""

    def stepped(p: Scalars, x: Scalars, u: Scalars, h):
        numbers, state = dict(zip(names, p, strict=True)), dict(zip(robot.states, x, strict=True))
        after = step(robot, state, u, h, numbers, friction)
        return tuple(after[name] for name in robot.states)

    def shown(p: Scalars, x: Scalars, u: Scalars):
        numbers, state = dict(zip(names, p, strict=True)), dict(zip(robot.states, x, strict=True))
        return tuple(jnp.asarray(y, float) for y in robot.observe(state, u, numbers))

    sizes = len(names), len(robot.states), len(robot.channels.inputs)
    places = tuple(robot.states.index(name) for name in fixed)
    identity = identity_of(robot, names, step, friction, fixed)
    return System(stepped, shown, sizes, len(robot.channels.measured), places, identity)


def machine_rollout(
    robot: Robot,
    p: Numbers,
    start: State,
    inputs: Float[Array, "T *n nu"],
    dt: Float[Array, " T"],
    substeps: int,
    step: Step,
    friction: DryFriction,
    fixed: Mapping[str, Float[Array, " T"]],
) -> Float[Array, "T ny"] | None:
    """Outputs at the samples, `inputs` with one row a sample or one a sub-step; None where this takes XLA.

    That is: on another device than a processor or a GPU of NVIDIA's, in single precision, and where a function of the robot
    uses what has no translation, which is said once (`SlowSimulation`).
    """
    if jax.default_backend() not in ("cpu", "gpu") or dt.dtype != jnp.float64:
        return None
    system = system_of(robot.structure, tuple(p), step, friction, tuple(fixed))
    rows = inputs if inputs.ndim == 3 else inputs[:, None]
    known = jnp.stack([*fixed.values()], axis=1) if fixed else jnp.zeros((len(dt), 0))
    shares = jnp.full(substeps, 1.0 / substeps)
    try:
        return rollout(system, [p[n] for n in p], [start[n] for n in robot.states], rows, dt, shares, known)
    except Untranslated as missing:
        warnings.warn(
            f"the simulation of {robot.name!r} has no machine code ({missing}); it runs in XLA, several times slower",
            SlowSimulation,
            stacklevel=2,
        )
        return None
