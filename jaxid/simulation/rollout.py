"""Rollouts: one experiment integrated over its whole record.

Fixed-step Runge-Kutta 4 with the dry-friction torques of `friction` held over each step. The right-hand side stands
once in the compiled program (a scan over the four stages), which keeps compilation short; lanes (experiments, tangents,
starts) come from `jax.vmap` around it.
"""

import math
import operator
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial, reduce
from types import MappingProxyType
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..parameters import ParameterError
from ..robots.effect import Numbers, Scalars, State
from ..robots.robot import Robot
from ..robots.scales import time_constant
from ..robots.signal_path import overrides, passed, sent
from .friction import DryFriction, Sticking
from .machine_rollout import machine_rollout

_RESOLVED = 0.015
"""Sampling interval in time constants up to which one step a sample does."""
_MOST_STEPS = 12
"""Steps a sample beyond which only stability counts: inputs are held for a sample, within which fast motions die out. The error
is then some millionths of the motion (`tests/simulation`), and a fit asks whether that is little enough."""
_MOST_SHARES = 40
"""Steps a sample beyond which several of them share what arrives of the inputs."""
_TOO_MANY_STEPS = 10_000
"""Steps a sample that no robot needs: its numbers are not those of a robot that was logged at this rate."""


@dataclass(frozen=True)
class Integrator:
    """How a rollout is integrated: `substeps` between two samples and the dry-friction law."""

    substeps: int = 4
    friction: DryFriction = Sticking()

    def __post_init__(self) -> None:
        try:
            whole = operator.index(self.substeps) >= 1
        except TypeError:
            whole = False
        if not whole:
            raise ParameterError(
                f"substeps = {self.substeps!r} is no number of steps; give in how many an interval between two samples is "
                "divided, such as 4"
            )

    @staticmethod
    def suited(robot: Robot, sampling_interval: float, friction: DryFriction | None = None) -> "Integrator":
        """The integrator whose steps suit the robot's time constants (`steps_per_time_constant`, or its own `max_step`), or
        shorter ones where an effect asks for it or a fit found that they must be (`longest_step`).

        Their number is a power of two or three times one, so that most start values share their compiled programs.

        One step a sample where samples are a hundredth of the time constant apart or less, else at least two: a step
        through a reversal is of second order. Stiff states (a filter far faster than the samples) get no more steps
        than make the integrator stable.

        Raises `ParameterError` where that takes more than 10,000 steps a sample.
        """
        if robot.max_step is not None:
            steps = math.ceil(sampling_interval / robot.max_step - 1e-6)
        else:
            share = sampling_interval / time_constant(robot)
            steps = max(math.ceil(share * robot.steps_per_time_constant - 1e-6), 2 if share > _RESOLVED else 1)
            steps = _round_number(min(steps, max(_MOST_STEPS, math.ceil(share))))
        finer = max((effect.finer for effect in robot.effects), default=1.0)
        found = math.ceil(sampling_interval / robot.longest_step - 1e-6)
        steps = max(1, found, math.ceil(finer * steps - 1e-6))
        if steps > _TOO_MANY_STEPS:
            raise ParameterError(
                f"With its present numbers the robot has motions so fast that samples {sampling_interval:.3g} s apart "
                f"would take {steps:.1g} integration steps each; check the units of its parameters and of the time column, "
                "and declare dry friction (`dry_friction=` or `axes=` of a `Custom`) rather than write it as a sign or a steep "
                "function of a speed."
            )
        return Integrator(steps, friction or Sticking())


def _round_number(steps: int) -> int:
    """The least of 1, 2, 3, 4, 6, 8, 12, 16, 24 ... that is not below `steps`."""
    power = 2 ** math.ceil(math.log2(steps))
    return 3 * power // 4 if power >= 4 and 3 * power // 4 >= steps else power


def _plus(state: State, h, rates: State) -> State:
    return {name: state[name] + h * rates[name] for name in state}


def step(robot: Robot, state: State, inputs: Scalars, h, p: Numbers, friction: DryFriction) -> State:
    """The state one step of `h` seconds later, the inputs held."""
    volts = robot.effective_inputs(state, inputs, h, p)
    held = friction.held(robot, state, volts, h, p)

    def stage(carry, weights):
        rates, total = carry
        reach, share = weights
        here = _plus(state, h * reach, rates)
        rates = robot.rates(here, volts, friction.present(robot, here, held, p), p)
        rates = {name: jnp.broadcast_to(rates[name], jnp.shape(state[name])) + 0.0 * state[name] for name in state}
        return (rates, _plus(total, h * share, rates)), None

    zero = {name: 0.0 * value for name, value in state.items()}
    weights = (jnp.array([0.0, 0.5, 0.5, 1.0]), jnp.array([1.0, 2.0, 2.0, 1.0]) / 6.0)
    (_, after), _ = jax.lax.scan(stage, (zero, state), weights)
    return robot.settle(state, after, inputs, h, p)


def begins_in_motion(robot: Robot, start: Mapping[str, Any]) -> Any:
    """Whether any velocity differs from zero in the states `start`, as 0.0 or 1.0: a robot at rest starts at zero exactly."""
    moving = [jnp.asarray(start[name]) != 0.0 for name in robot.velocities if name in start]
    return jnp.asarray(reduce(jnp.logical_or, moving), float) if moving else 0.0


def commanded(
    robot: Robot, p: Numbers, inputs: Float[Array, "T nu"], dt: Float[Array, " T"], substeps: int, held: Any = 0.0
):
    """What arrives of the inputs [T, substeps, nu] in every substep: effects on commands act at the integrator's pace, up to
    one far finer than logs; of still shorter steps several share what arrives on average. `held` as `sent` has it."""
    parts = shares_of_a_step(substeps)
    fine = sent(robot, jnp.repeat(inputs, parts, axis=0), *fine_clock(dt, parts), p, held)
    return jnp.repeat(fine.reshape(len(dt), parts, -1), substeps // parts, axis=1)


def shares_of_a_step(substeps: int) -> int:
    """In how many parts of a sample effects on commands act."""
    parts = max(n for n in range(1, _MOST_SHARES + 1) if substeps % n == 0)
    return parts if 2 * parts > _MOST_SHARES else substeps


def fine_clock(dt: Any, parts: int, numpy: Any = jnp) -> tuple[Any, Any]:
    """When the `parts` of every sample begin, from 0, and how long each lasts [*E, T * parts], of samples of `dt` [*E, T];
    `numpy`: JAX's or NumPy."""
    fine = numpy.repeat(dt / parts, parts, axis=-1)
    time = numpy.concatenate([numpy.zeros_like(dt[..., :1]), numpy.cumsum(dt, axis=-1)[..., :-1]], axis=-1)
    within = numpy.tile(numpy.arange(parts), dt.shape[-1])
    return numpy.repeat(time, parts, axis=-1) + within * fine, fine


_PARTS, _MORE_PARTS = (2, 3), (4, 3, 2)
"""In how many parts what a late sensor measures is looked at between two samples, the first that divides the sub-steps: its
error falls to a seventh and, where commands arrive between samples, to a twentieth (`tests/simulation`)."""


def parts_of_a_sample(robot: Robot, substeps: int) -> int:
    """How often what a sensor measures is needed in the time of a sample.

    A lag or delay of a sensor takes motion for parabolas between what it is given, and kinks for at these. An effect on
    commands that remembers, such as a delay, puts them between two samples, too.
    """
    effects = robot.effects
    if not any(effect.late and overrides(type(effect), "measure") for effect in effects):
        return 1
    between = any(overrides(type(effect), "command") and not effect.memoryless for effect in effects)
    return next((k for k in (_MORE_PARTS if between else _PARTS) if substeps % k == 0), 1)


def by_outputs(inputs: Any, parts: int) -> Any:
    """Inputs of every sample, or of every sub-step of each [*c, T, R, U], as those after each of `parts` outputs a sample
    [*c, T * parts, r, U]."""
    *c, T, R, U = inputs.shape
    if R == 1 and parts > 1:
        return (np if isinstance(inputs, np.ndarray) else jnp).repeat(inputs, parts, axis=-3)
    return inputs.reshape(*c, T * parts, R // parts, U)


def _scanned(robot: Robot, p: Numbers, start: State, inputs, dt, integrator: Integrator, fixed):
    """Outputs at the samples as XLA's scan over samples and sub-steps; `inputs` one row a sample or one a sub-step."""
    n, fine = integrator.substeps, inputs.ndim == 3

    def sample(state: State, row):
        u, interval, known = row
        state = {**state, **known}
        outputs = jnp.stack([jnp.asarray(y, float) for y in robot.observe(state, tuple(u[0] if fine else u), p)])

        def substep(s: State, held_inputs):
            volts = tuple(u) if held_inputs is None else tuple(held_inputs)
            return step(robot, s, volts, interval / n, p, integrator.friction), None

        state, _ = jax.lax.scan(substep, state, u if fine else None, length=n)
        return state, outputs

    _, outputs = jax.lax.scan(sample, start, (inputs, dt, dict(fixed)))
    return outputs


def rollout(
    robot: Robot,
    p: Numbers,
    start: State,
    inputs: Float[Array, "T nu"],
    dt: Float[Array, " T"],
    integrator: Integrator,
    prescribed: Mapping[str, Float[Array, " T"]] = MappingProxyType({}),
    in_xla: bool = False,
    moving: Any = None,
) -> Float[Array, "T ny"]:
    """Outputs at the sample times of one experiment.

    Row k of `inputs` acts from sample k to k+1, `dt[k]` seconds later (zero-order hold); row k of the result is what
    the sensors of the model show at sample k. `moving` (0 or 1): whether it begins in motion, with its first command held
    before; by default where a velocity in `start` differs from zero. States in `prescribed` are set to these values at every
    sample. Runs under `jit`, `vmap` and first derivatives (forward mode; reverse mode by parameters and initial states).

    On a processor this is machine code made of the robot's own functions (`jaxid.kernel`), on other devices, and for
    functions that have no translation, or with `in_xla`, XLA's scan.
    """
    time = jnp.concatenate([jnp.zeros(1), jnp.cumsum(dt)[:-1]])
    moving = begins_in_motion(robot, start) if moving is None else moving
    if any(overrides(type(effect), "command") for effect in robot.effects):
        inputs = commanded(robot, p, inputs, dt, integrator.substeps, moving)
    parts = parts_of_a_sample(robot, integrator.substeps) if not prescribed else 1
    if parts > 1:
        integrator = Integrator(integrator.substeps // parts, integrator.friction)
        fine = inputs.ndim == 3
        inputs = by_outputs(inputs if fine else inputs[:, None], parts)
        inputs = inputs if fine else inputs[:, 0]
        dt = jnp.repeat(dt / parts, parts)
        time = jnp.concatenate([jnp.zeros(1), jnp.cumsum(dt)[:-1]])
    start = {name: jnp.asarray(start[name], dtype=float) for name in robot.states}
    outputs = None
    if not in_xla:
        n, friction = integrator.substeps, integrator.friction
        outputs = machine_rollout(robot, p, start, inputs, dt, n, step, friction, prescribed)
    if outputs is None:
        outputs = _scanned(robot, p, start, inputs, dt, integrator, prescribed)
    return passed(robot, "measure", outputs, time, p, moving=moving)[::parts]


rollout_in_xla = partial(rollout, in_xla=True)
"""`rollout` by XLA alone: the reference for the machine code, and for derivatives of any order and mode."""
