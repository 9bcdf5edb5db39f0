"""How a robot's state passes into a later state, into the outputs and into their rates, linearised at many states at once."""

from collections.abc import Mapping
from functools import lru_cache, partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from .._compile import compiled
from ..kernel.call import System
from ..kernel.direct import outputs, tangents
from ..kernel.groups import grouped, ungrouped
from ..kernel.identity import identity_of
from ..kernel.machine import lanes
from ..kernel.symbolic import Untranslated
from ..robots.effect import Numbers, Scalars
from ..robots.robot import Robot
from .friction import DryFriction
from .machine_rollout import system_of
from .rollout import Integrator, step

Array = np.ndarray
_MOST_MODELS = 256


def transitions(
    robot: Robot,
    integrator: Integrator,
    names: tuple[str, ...],
    starts: Mapping[str, Float[Array, " W"]],
    inputs: Float[Array, "W n nu"],
    dt: Float[Array, "W n"],
) -> tuple[Float[Array, "W s s"], Float[Array, "W ny s"]]:
    """The transition matrices of the states `names` over W stretches of n samples each, and d(outputs)/d(state) where these
    begin. Effects on commands and sensors count as absent. Call under float64.
    """
    W, n, nu = inputs.shape
    if n and jax.default_backend() == "cpu":
        try:
            return _transitions_directly(robot, integrator, names, starts, inputs, dt)
        except Untranslated:
            pass
    numbers = {name: np.asarray(float(value)) for name, value in robot.parameters.numbers.items()}
    whole = {name: np.broadcast_to(np.asarray(value, float), (W,)) for name, value in starts.items()}
    found = _transitions_in_xla(robot.structure, integrator, names, numbers, whole, inputs, dt)
    return np.asarray(found[0]), np.asarray(found[1])


@lru_cache(_MOST_MODELS)
def showing_states(robot: Robot, names: tuple[str, ...], friction: DryFriction, fixed: tuple[str, ...] = ()) -> System:
    """The robot with its states as outputs, before those that it has; states `fixed` are set at every sample."""
    plain = system_of(robot, names, step, friction, fixed)

    def shown(p: Scalars, x: Scalars, u: Scalars):
        return (*x, *plain.output(p, x, u))

    return plain.showing(shown, len(robot.states) + plain.outputs, "states and outputs")


def _transitions_directly(robot, integrator, names, starts, inputs, dt) -> tuple[Array, Array]:
    parameters = robot.parameters.numbers
    system = showing_states(robot.structure, tuple(parameters), integrator.friction)
    p = np.array([float(value) for value in parameters.values()])
    own = [robot.states.index(name) for name in names]
    shares = np.full((integrator.substeps, lanes()), 1.0 / integrator.substeps)
    moved = np.zeros((len(names), len(robot.states)))
    moved[np.arange(len(own)), own] = 1.0
    # The last sample only ends the last interval.
    u, d = (np.concatenate([a, a[:, -1:]], axis=1) for a in (np.asarray(inputs, float), np.asarray(dt, float)))
    x = np.stack([np.broadcast_to(np.asarray(starts[name], float), (len(u),)) for name in robot.states], axis=1)
    phi, seen = [], []
    for first in range(0, len(u), lanes()):  # of long stretches, more at a time would fill the memory
        some = slice(first, first + lanes())
        E, T = d[some].shape
        both = grouped(np.tile(p, (E, 1))), grouped(x[some]), grouped(u[some][:, :, None, :]), grouped(d[some])
        run = (shares, *both, grouped(np.zeros((E, T, 0))))
        directions = grouped(np.zeros((E, len(names), 0))), grouped(np.tile(moved, (E, 1, 1)))
        dy = ungrouped(tangents(system, (), run, *directions), E)  # [E, T, Y, K]
        phi.append(dy[:, -1, own])
        seen.append(dy[:, 0, len(robot.states) :])
    return np.concatenate(phi), np.concatenate(seen)


@partial(compiled, static_argnames=("robot", "integrator", "names"))
def _transitions_in_xla(robot: Robot, integrator: Integrator, names: tuple[str, ...], numbers, starts, inputs, dt):
    def one(start, u, d):
        def state(x):
            return {**start, **dict(zip(names, x, strict=True))}

        def end(x):
            def sample(s, row):
                held, interval = row

                def substep(s, _):
                    return step(
                        robot, s, tuple(held), interval / integrator.substeps, numbers, integrator.friction
                    ), None

                return jax.lax.scan(substep, s, None, length=integrator.substeps)[0], None

            begin = {name: jnp.asarray(value, float) for name, value in state(x).items()}
            after = jax.lax.scan(sample, begin, (u, d))[0]
            return jnp.stack([after[name] for name in names])

        def seen(x):
            return jnp.stack([jnp.asarray(y, float) for y in robot.observe(state(x), tuple(u[0]), numbers)])

        x = jnp.stack([start[name] for name in names])
        return jax.jacfwd(end)(x), jax.jacfwd(seen)(x)

    return jax.vmap(one)(starts, inputs, dt)


def output_slopes(
    robot: Robot,
    names: tuple[str, ...],
    states: Mapping[str, Float[Array, " W"]],
    inputs: Float[Array, "W nu"],
    interval: float,
) -> tuple[Float[Array, "W m"], Float[Array, "W m s"]]:
    """The ny outputs and their rates of change, m = 2 ny, in W states, and the derivatives of both by the states `names`;
    dry friction, which acts on accelerations only, left out. Inputs are held for `interval` seconds. Call under float64.
    """
    parameters = robot.parameters.numbers
    p = np.array([*(float(value) for value in parameters.values()), float(interval)])
    x = np.stack([np.broadcast_to(np.asarray(states[name], float), (len(inputs),)) for name in robot.states], axis=1)
    u = np.asarray(inputs, float)
    if jax.default_backend() == "cpu":
        try:
            return _output_slopes_directly(_resting(robot.structure, tuple(parameters)), robot, names, p, x, u)
        except Untranslated:
            pass
    found = _output_slopes_in_xla(robot.structure, tuple(parameters), names, p, x, u)
    return np.asarray(found[0]), np.asarray(found[1])


def _outputs_and_rates(robot: Robot, names: tuple[str, ...], p: Scalars, x: Scalars, u: Scalars):
    """`p`: the parameters `names` and the interval over which the inputs are held."""
    numbers: Numbers = dict(zip(names, p[:-1], strict=True))
    state = dict(zip(robot.states, x, strict=True))

    def seen(state):
        return tuple(jnp.asarray(y, float) for y in robot.observe(state, u, numbers))

    dry = (0.0,) * len(robot.rubbing(state, numbers))
    rates = robot.rates(state, robot.effective_inputs(state, u, p[-1], numbers), dry, numbers)
    rates = {name: jnp.asarray(rates[name], float) + 0.0 * state[name] for name in state}
    y, ydot = jax.jvp(seen, (state,), (rates,))
    return (*y, *ydot)


@lru_cache(_MOST_MODELS)
def _resting(robot: Robot, names: tuple[str, ...]) -> System:
    """A system that stays where it is and shows outputs and rates."""

    def shown(p: Scalars, x: Scalars, u: Scalars):
        return _outputs_and_rates(robot, names, p, x, u)

    sizes = len(names) + 1, len(robot.states), len(robot.channels.inputs)
    identity = identity_of(robot, names, "outputs and rates")
    return System(lambda p, x, u, h: x, shown, sizes, 2 * len(robot.channels.measured), identity=identity)


def _output_slopes_directly(system: System, robot: Robot, names, p, x, u) -> tuple[Array, Array]:
    W, S = x.shape
    moved = np.zeros((len(names), S))
    moved[np.arange(len(names)), [robot.states.index(name) for name in names]] = 1.0
    both = grouped(np.tile(p, (W, 1))), grouped(x), grouped(u[:, None, None, :]), grouped(np.ones((W, 1)))
    run = (np.ones((1, lanes())), *both, grouped(np.zeros((W, 1, 0))))
    directions = grouped(np.zeros((W, len(names), 0))), grouped(np.tile(moved, (W, 1, 1)))
    return ungrouped(outputs(system, run), W)[:, 0], ungrouped(tangents(system, (), run, *directions), W)[:, 0]


@partial(compiled, static_argnames=("robot", "parameters", "names"))
def _output_slopes_in_xla(robot: Robot, parameters: tuple[str, ...], names: tuple[str, ...], p, x, u):
    own = np.array([robot.states.index(name) for name in names])

    def one(x, u):
        def seen(part):
            state = tuple(x.at[own].set(part))
            return jnp.stack(_outputs_and_rates(robot, parameters, tuple(p), state, tuple(u)))

        y, back = jax.linearize(seen, x[own])
        return y, jax.vmap(back, out_axes=-1)(jnp.eye(len(names)))

    return jax.vmap(one)(x, u)
