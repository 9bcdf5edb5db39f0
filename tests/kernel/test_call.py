"""jaxid/kernel: machine code against XLA's scan, on every robot, under jit, vmap, forward and reverse mode, ties included."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxid import Axis, Custom, Integrator, Omni, Parameter, Pioneer, Smooth, Sticking
from jaxid.effects import effect_by_id
from jaxid.logs import Channels
from jaxid.simulation.machine_rollout import SlowSimulation
from jaxid.simulation.rollout import rollout, rollout_in_xla

SAMPLES = 60


def _swinging(state, inputs, p, friction):
    pull = inputs["u"] - p["g"] * jnp.sin(state["q"]) - p["b"] * state["w"] * jnp.abs(state["w"]) - friction["pivot"]
    return {"q": state["w"], "w": pull / p["J"]}


def pendulum(dynamics=_swinging):
    table = {
        name: Parameter(value, free=True, lower=0.0)
        for name, value in {"J": 0.1, "g": 1.0, "b": 0.02, "c": 0.05}.items()
    }
    channels = Channels(inputs=("u",), outputs=("q",), units={})
    return Custom(dynamics=dynamics, state_names=("q", "w"), own_channels=channels, table=table,
                  dry_friction=(("pivot", "w", "c"),))  # fmt: skip


ROBOTS = {
    "axis": Axis(),
    "omni with inductance": Omni(inductance=True),
    "pioneer": Pioneer(),
    "pendulum": pendulum(),
    **{
        f"axis + {effect}": Axis() + effect_by_id(Axis(), effect)
        for effect in ("stribeck_friction", "cogging_torque", "input_delay", "motor_lag")
    },
}

LONG = ("omni with inductance", "pioneer", "axis + cogging_torque", "axis + motor_lag")
"""What XLA compiles for seconds and has a like above."""


def experiments(robot, lanes=3, seed=0):
    rng = np.random.default_rng(seed)
    inputs = jnp.asarray(
        np.repeat(rng.choice([-6.0, 0.0, 6.0], size=(lanes, SAMPLES // 10, len(robot.channels.inputs))), 10, 1)
    )
    dt = jnp.asarray(rng.uniform(0.015, 0.025, size=(lanes, SAMPLES)))
    return inputs, dt


def sensitivities(robot, run, friction):
    """Outputs and their derivatives by all free parameters and the first state, all lanes at once."""
    names = robot.parameters.free_names
    numbers = {name: jnp.asarray(value if value else 0.02) for name, value in robot.parameters.numbers.items()}
    inputs, dt = experiments(robot)
    at_rest = {name: jnp.asarray(value) for name, value in robot.initial_state().items()}
    integrator = Integrator(3, friction)

    def outputs(x, u, interval):
        start = {**at_rest, robot.states[0]: x[-1]}
        return run(robot, {**numbers, **dict(zip(names, x, strict=False))}, start, u, interval, integrator)

    x = jnp.array([*(numbers[name] for name in names), 0.0])
    columns = jnp.eye(x.size)

    @jax.jit
    def all_lanes(x, inputs, dt):
        def lane(u, interval):
            return jax.vmap(lambda t: jax.jvp(lambda x: outputs(x, u, interval), (x,), (t,)), out_axes=(None, -1))(
                columns
            )

        return jax.vmap(lane)(inputs, dt)

    return all_lanes(x, inputs, dt)


@pytest.mark.usefixtures("double_precision")
@pytest.mark.parametrize(
    ("name", "friction"),
    [
        *(pytest.param(name, Sticking(), marks=[pytest.mark.slow] * (name in LONG)) for name in ROBOTS),
        ("pendulum", Smooth(0.05)),
    ],
)
def test_outputs_and_sensitivities_are_those_of_xla(name, friction):
    robot = ROBOTS[name]
    y, dy = sensitivities(robot, rollout, friction)
    expected, slopes = sensitivities(robot, rollout_in_xla, friction)
    assert np.isfinite(np.asarray(expected)).all() and np.ptp(np.asarray(expected)) > 0
    np.testing.assert_allclose(y, expected, rtol=0, atol=1e-12 * float(jnp.max(jnp.abs(expected))))
    size = jnp.max(jnp.abs(slopes), axis=(0, 1, 2))
    np.testing.assert_allclose(
        dy / jnp.where(size > 0, size, 1.0), slopes / jnp.where(size > 0, size, 1.0), rtol=0, atol=1e-9
    )


@pytest.mark.usefixtures("double_precision")
def test_a_prescribed_state_passes_no_sensitivity_on():
    robot = ROBOTS["axis + cogging_torque"]
    path = {"q": jnp.sin(jnp.arange(SAMPLES) / 10.0)}
    y, dy = sensitivities(robot, partial(rollout, prescribed=path), Sticking())
    expected, slopes = sensitivities(robot, partial(rollout_in_xla, prescribed=path), Sticking())
    np.testing.assert_allclose(y, expected, rtol=0, atol=1e-12 * float(jnp.max(jnp.abs(expected))))
    np.testing.assert_allclose(dy, slopes, rtol=0, atol=1e-9 * float(jnp.max(jnp.abs(slopes))))
    q = robot.channels.measured.index("q")
    assert not np.asarray(dy)[:, :, q].any() and np.asarray(dy)[:, :, 1 - q].any()


@pytest.mark.usefixtures("double_precision")
def test_reverse_mode_agrees_with_finite_differences():
    robot = pendulum()
    inputs, dt = experiments(robot)
    numbers = {name: jnp.asarray(value) for name, value in robot.parameters.numbers.items()}

    def energy(J):
        start = {"q": jnp.asarray(0.3), "w": jnp.zeros(())}
        return jnp.sum(rollout(robot, {**numbers, "J": J}, start, inputs[0], dt[0], Integrator(2)) ** 2)

    step = 1e-5
    difference = (energy(0.1 + step) - energy(0.1 - step)) / (2 * step)
    assert jax.grad(energy)(jnp.asarray(0.1)) == pytest.approx(float(difference), rel=1e-5)


@pytest.mark.filterwarnings("error::jaxid.simulation.machine_rollout.SlowSimulation")
@pytest.mark.usefixtures("double_precision")
def test_small_arrays_in_a_users_function_are_translated_inside_a_program_too():
    def stacked(state, inputs, p, friction):
        rates = _swinging(state, inputs, p, friction)
        both = jnp.stack([rates["q"], rates["w"]]) @ jnp.eye(2)
        return {"q": both[0], "w": both[1]}

    robot, plain = pendulum(stacked), pendulum()
    inputs, dt = experiments(robot)
    numbers = {name: jnp.asarray(value) for name, value in robot.parameters.numbers.items()}
    start = {"q": jnp.asarray(0.3), "w": jnp.zeros(())}
    found = jax.jit(lambda u: rollout(robot, numbers, start, u, dt[0], Integrator(2)))(inputs[0])
    np.testing.assert_allclose(found, rollout(plain, numbers, start, inputs[0], dt[0], Integrator(2)), atol=1e-12)


@pytest.mark.usefixtures("double_precision")
def test_what_has_no_translation_runs_in_xla_and_says_so():
    def searching(state, inputs, p, friction):
        rates = _swinging(state, inputs, p, friction)
        return {**rates, "w": jnp.sort(jnp.stack([rates["w"], 1e3]))[0]}

    robot, plain = pendulum(searching), pendulum()
    inputs, dt = experiments(robot)
    numbers = {name: jnp.asarray(value) for name, value in robot.parameters.numbers.items()}
    start = {"q": jnp.asarray(0.3), "w": jnp.zeros(())}
    with pytest.warns(SlowSimulation, match="sort"):
        found = rollout(robot, numbers, start, inputs[0], dt[0], Integrator(2))
    np.testing.assert_allclose(found, rollout(plain, numbers, start, inputs[0], dt[0], Integrator(2)), atol=1e-12)
