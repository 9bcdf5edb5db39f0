"""Integration without friction against an adaptive solver, and what a sample's row means."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxid import Axis, Integrator, ParameterError, Pioneer, Sticking
from jaxid.simulation.rollout import rollout
from reference.logs import simulate as exact_run
from reference.pioneer import PIONEER

pytestmark = pytest.mark.usefixtures("double_precision")
T = 64
ONE_STEP = Integrator(1)
NO_DRY = dict(Cs=0.0, Cs1=0.0, tau_fr=0.0)


@partial(jax.jit, static_argnames=("robot", "integrator"))
def run(robot, p, inputs, dt, integrator, start=None):
    return rollout(robot, p, robot.initial_state() if start is None else start, inputs, dt, integrator)


def simulated(robot, inputs, dt, integrator=ONE_STEP, start=None, **changes):
    p = {k: jnp.asarray(v) for k, v in (robot.parameters.numbers | changes).items()}
    return np.asarray(run(robot.structure, p, jnp.asarray(inputs, float), jnp.asarray(dt), integrator, start))


def held_inputs(seed, columns=2):
    return np.repeat(np.random.default_rng(seed).uniform(-8, 8, (T // 8, columns)), 8, axis=0)


def adaptive(inputs, dt):
    """The Pioneer without dry friction by DOP853, restarted wherever the input changes."""
    robot = Pioneer()
    p = robot.parameters.numbers | NO_DRY

    @jax.jit
    def rates(y, u):
        state = dict(zip(robot.states, y, strict=True))
        found = robot.rates(state, (u[0], u[1]), (0.0, 0.0, 0.0), p)
        return jnp.stack([found[name] for name in robot.states])

    y, rows = np.zeros(3), []
    for u, interval in zip(inputs, dt, strict=True):
        rows.append(y[1:])
        y = solve_ivp(lambda t, y, u=u: np.asarray(rates(y, u)), (0, interval), y, "DOP853", rtol=1e-11, atol=1e-13).y[
            :, -1
        ]
    return np.array(rows)


def test_without_dry_friction_the_error_is_of_fourth_order_also_with_irregular_samples():
    inputs = held_inputs(1)
    dt = np.random.default_rng(2).uniform(0.01, 0.03, T)
    truth = adaptive(inputs, dt)
    errors = [np.abs(simulated(Pioneer(), inputs, dt, Integrator(n), **NO_DRY) - truth).max() for n in (1, 2, 4)]
    orders = np.log2(np.array(errors)[:-1] / np.array(errors)[1:])
    assert np.all(orders > 3.5), orders
    assert errors[2] < 1e-6


def test_row_k_of_the_input_acts_from_sample_k_to_the_next():
    inputs = np.zeros((T, 1))
    inputs[5] = 1.0
    robot = Axis().with_values(Fv=0.0, Fc=0.0)
    speed = simulated(robot, inputs, np.full(T, 0.02))[:, 0]
    np.testing.assert_array_equal(speed[:6], 0.0)  # sample 5 is taken before its input has acted
    np.testing.assert_allclose(speed[6:], 0.02, rtol=1e-12)  # 1 N on 1 kg for 0.02 s


def test_irregular_intervals_are_each_steps_own():
    robot = Axis().with_values(Fv=0.0, Fc=0.0)
    dt = np.random.default_rng(3).uniform(0.001, 0.1, T)
    outputs = simulated(robot, np.ones((T, 1)), dt)
    time = np.concatenate([[0], np.cumsum(dt)[:-1]])
    np.testing.assert_allclose(outputs, np.stack([time, 0.5 * time**2], axis=1), atol=1e-12)


def test_the_last_input_is_never_felt():
    inputs = held_inputs(4)
    other = inputs.copy()
    other[-1] = 99.0
    dt = np.full(T, 0.02)
    np.testing.assert_array_equal(simulated(Pioneer(), inputs, dt), simulated(Pioneer(), other, dt))


def test_substeps_shorten_the_step_alone():
    inputs, dt = held_inputs(5), np.full(T, 0.02)
    split = simulated(Pioneer(), np.repeat(inputs, 2, axis=0)[:T], np.full(T, 0.01))
    np.testing.assert_allclose(simulated(Pioneer(), inputs, dt, Integrator(2))[: T // 2], split[::2], atol=1e-13)


def test_lanes_of_a_batch_are_the_single_rollouts():
    inputs = jnp.asarray(np.stack([held_inputs(6), held_inputs(7), held_inputs(8)]))
    dt = jnp.full(T, 0.02)
    p = {k: jnp.asarray(v) for k, v in Pioneer().parameters.numbers.items()}
    lanes = jax.jit(jax.vmap(lambda u: rollout(Pioneer(), p, Pioneer().initial_state(), u, dt, Integrator(1))))(inputs)
    for lane, u in zip(lanes, inputs, strict=True):
        np.testing.assert_allclose(lane, simulated(Pioneer(), u, dt), atol=1e-12)


def test_a_start_in_motion_with_the_caster_across_matches_the_event_accurate_simulator():
    inputs = held_inputs(9)
    start = {"beta": 1.2, "eta1": 0.3, "eta2": -0.8}
    exact = exact_run(PIONEER, inputs, 0.02, start={3: 1.2, 4: 0.3, 5: -0.8})
    outputs = simulated(
        Pioneer(), inputs, np.full(T, 0.02), Integrator(4), {k: jnp.asarray(v) for k, v in start.items()}
    )
    np.testing.assert_allclose(outputs[0], [0.3, -0.8])
    np.testing.assert_allclose(outputs, exact.speeds, atol=2e-4)


def test_pose_and_wheel_angles_ride_along_without_changing_the_speeds():
    robot = Pioneer(pose=True, wheel_angles=True)
    inputs, dt = held_inputs(10), np.full(T, 0.02)
    outputs = simulated(robot, inputs, dt)
    np.testing.assert_allclose(outputs[:, :2], simulated(Pioneer(), inputs, dt), atol=1e-13)


def test_the_suited_integrator_steps_no_longer_than_the_robot_allows():
    for interval, substeps in ((0.02, 2), (0.021, 3), (0.005, 2), (0.001, 1), (0.1, 12)):
        assert Integrator.suited(Pioneer(), interval) == Integrator(substeps, Sticking())


def test_integration_steps_do_not_depend_on_the_unit_of_time():
    for unit in (1e-3, 1.0, 1e3):
        robot = Axis().with_values(M=1.3, Fv=2.6 / unit)  # a time constant of half a second
        for interval, substeps in ((0.02, 2), (0.1, 3), (0.005, 1)):
            assert Integrator.suited(robot, interval * unit).substeps == substeps


def test_numbers_of_steps_are_few_so_that_start_values_share_programs():
    found = set()
    for share in np.geomspace(0.01, 30.0, 200):
        found.add(Integrator.suited(Axis().with_values(M=0.02 / share, Fv=1.0, Fc=0.0), 0.02).substeps)
    assert len(found) <= 13 and {1, 2, 3} <= found
    for steps in found:  # a power of two, or three times one
        assert steps & (steps - 1) == 0 or (steps % 3 == 0 and (steps // 3) & (steps // 3 - 1) == 0)


@pytest.mark.parametrize("share", [0.5, 1.0, 2.0, 4.0, 8.0, 11.0])
def test_twelve_steps_a_sample_follow_motions_that_die_out_within_one(axis_law, share):
    """Such as those of small motors behind large gears, at a hundredth of the error that a good sensor's noise hides."""
    robot = Axis().with_values(M=0.02 * 2.0 / share, Fv=2.0, Fc=0.5, offset=0.0)
    random = np.random.default_rng(5)
    inputs = np.cumsum(random.normal(0.0, 0.3, 400)) + np.repeat(random.uniform(-4.0, 4.0, 16), 25)
    exact, _ = axis_law(inputs, 0.02, M=0.04 / share)
    steps = Integrator.suited(robot, 0.02)
    found = simulated(robot, inputs[:, None], np.full(400, 0.02), steps)[:, 0]
    assert steps.substeps <= 12 and (exact == 0.0).sum() > 5
    assert np.sqrt(np.mean((found - exact) ** 2)) < 3e-5 * np.sqrt(np.mean(exact**2))


@pytest.mark.parametrize("steps", [0.001, 0, -2, 2.0, None])
def test_what_is_no_number_of_steps_is_said(steps):
    with pytest.raises(ParameterError, match="is no number of steps"):
        Integrator(steps)
