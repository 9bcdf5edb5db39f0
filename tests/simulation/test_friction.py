"""Dry friction in rollouts against a closed-form axis and the event-accurate simulator."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxid import Axis, Integrator, Pioneer, Smooth, Sticking
from jaxid.simulation.rollout import rollout
from reference import excitation
from reference.axis import AXIS
from reference.logs import simulate as exact_run
from reference.pioneer import PIONEER

pytestmark = pytest.mark.usefixtures("double_precision")
T, DT = 200, 0.02
AXIS_ROBOT = Axis().with_values(Fv=2.0, Fc=0.5)


@partial(jax.jit, static_argnames=("robot", "integrator"))
def run(robot, p, inputs, integrator):
    start = robot.initial_state()
    return rollout(robot, p, start, inputs, jnp.full(len(inputs), DT), integrator)


def simulated(robot, inputs, integrator, **changes):
    p = {k: jnp.asarray(v) for k, v in (robot.parameters.numbers | changes).items()}
    return np.asarray(run(robot.structure, p, jnp.asarray(inputs, float), integrator))


@pytest.fixture(scope="module")
def reversals():
    """Random levels of both signs, some below break-away: starts, stops, sticking and reversals."""
    return np.repeat(np.random.default_rng(3).uniform(-2, 2, T // 5), 5)


def test_the_closed_form_axis_agrees_with_the_event_accurate_simulator(axis_law, reversals):
    v, q = axis_law(reversals, DT)
    exact = exact_run(AXIS, reversals[:, None], DT)
    assert exact.events > 10
    np.testing.assert_allclose(exact.speeds[:, 0], v, atol=1e-10)
    np.testing.assert_allclose(exact.states[:, 0], q, atol=1e-10)
    assert np.mean(v == 0) > 0.05


def test_the_error_of_stick_slip_is_of_second_order_in_the_step(axis_law, reversals):
    v, q = axis_law(reversals, DT)
    errors = []
    for n in (1, 4, 16):
        outputs = simulated(AXIS_ROBOT, reversals[:, None], Integrator(n))
        errors.append([np.sqrt(np.mean((outputs[:, 0] - v) ** 2)), np.abs(outputs[:, 1] - q).max()])
    orders = np.log2(np.array(errors)[:-1] / np.array(errors)[1:]) / 2
    assert np.all(orders > 1.7), orders
    assert errors[0][0] < 2e-4 and errors[2][0] < 1e-6  # m/s, where the speeds reach 0.7 m/s


@pytest.mark.parametrize("share", [0.5, -0.999])
def test_below_break_away_a_single_axis_stands_still(share):
    outputs = simulated(AXIS_ROBOT, np.full((T, 1), share * 0.5), Integrator(1), M=1.3)
    assert np.abs(outputs).max() < 1e-15  # the rounding of its forces
    assert simulated(AXIS_ROBOT, np.full((T, 1), np.sign(share) * 0.501), Integrator(1))[-1, 0] != 0.0


def test_a_sliding_axis_comes_to_rest_and_stays(axis_law):
    inputs = np.where(np.arange(T) < 60, 2.0, 0.4)  # 0.4 would not start it and does not keep it going
    v, _ = axis_law(inputs, DT)
    outputs = simulated(AXIS_ROBOT, inputs[:, None], Integrator(1))
    stopped = np.flatnonzero(v == 0)[1:]
    after = stopped[stopped > 60][1:]
    assert len(after) > 20
    assert np.abs(outputs[after, 0]).max() < 1e-4 and np.abs(outputs[after[5:], 0]).max() < 1e-12


def test_a_robot_with_coupled_axes_rests_as_exactly_as_the_sweeps():
    volts = np.tile([0.7, -0.63], (T, 1))  # break-away is at 0.86 V
    creep = {}
    for sweeps in (2, 4):
        outputs = np.abs(simulated(Pioneer(), volts, Integrator(1, Sticking(sweeps))))
        creep[sweeps] = outputs.max(axis=0)
    assert np.all(creep[2] < [2e-5, 1e-4])  # m/s, rad/s: a thousandth of a sensor's noise
    assert np.all(creep[4] < creep[2] / 1000)


@pytest.fixture(scope="module")
def crawl():
    inputs = excitation.experiment("pioneer", "crawl", T, 5)
    return inputs, exact_run(PIONEER, inputs, DT)


def test_the_pioneer_creeping_and_reversing_follows_the_event_accurate_simulator(crawl):
    inputs, exact = crawl
    assert exact.events >= 4
    errors = {}
    for n in (1, 4):
        difference = simulated(Pioneer(), inputs, Integrator(n)) - exact.speeds
        errors[n] = np.sqrt(np.mean((difference / [0.01, 0.02]) ** 2))
    assert errors[1] < 0.02 and errors[4] < 0.001  # standard deviations of the noise
    assert errors[1] / errors[4] > 10


def test_derivatives_through_stick_slip_are_those_of_the_rollout_and_of_the_closed_form(axis_law, reversals):
    names = ("M", "Fv", "Fc", "offset")
    at = np.array([1.1, 1.9, 0.47, 0.03])
    base = {k: jnp.asarray(v) for k, v in Axis().parameters.numbers.items()}
    inputs = jnp.asarray(reversals[:, None])

    @jax.jit
    def speeds(values):
        p = base | dict(zip(names, values, strict=True))
        return rollout(Axis().structure, p, Axis().initial_state(), inputs, jnp.full(T, DT), Integrator(2))[:, 0]

    slopes = np.asarray(jax.jit(jax.jacfwd(speeds))(jnp.asarray(at)))
    step = 1e-6
    for j, name in enumerate(names):
        ahead, behind = at.copy(), at.copy()
        ahead[j] += step
        behind[j] -= step
        numeric = (np.asarray(speeds(ahead)) - np.asarray(speeds(behind))) / (2 * step)
        np.testing.assert_allclose(slopes[:, j], numeric, atol=2e-7, err_msg=name)
        exact = [axis_law(reversals, DT, **dict(zip(names, values, strict=True)))[0] for values in (ahead, behind)]
        difference = slopes[:, j] - (exact[0] - exact[1]) / (2 * step)
        assert np.sqrt(np.mean(difference**2)) < 0.02 * np.sqrt(np.mean(slopes[:, j] ** 2)), name


def test_the_smooth_law_converges_to_true_sticking_as_its_width_shrinks(axis_law, reversals):
    v, _ = axis_law(reversals, DT)
    errors = []
    for width in (0.01, 0.0025, 0.000625):
        outputs = simulated(AXIS_ROBOT, reversals[:, None], Integrator(16, Smooth(width)))
        errors.append(np.sqrt(np.mean((outputs[:, 0] - v) ** 2)))
    assert errors[0] / errors[1] > 3 and errors[1] / errors[2] > 3  # first order in the width: 4
    # at rest the smoothed axis creeps at width * artanh(share of break-away), as the law says
    outputs = simulated(AXIS_ROBOT, np.full((T, 1), 0.25), Integrator(16, Smooth(0.01)))
    assert outputs[-1, 0] == pytest.approx(0.01 * np.arctanh((0.25 - 2.0 * outputs[-1, 0]) / 0.5), rel=1e-6)


def test_friction_levels_that_differ_by_direction_hold_and_drag_each_their_own_way():
    from dataclasses import dataclass
    from typing import ClassVar

    from jaxid import Effect

    @dataclass(frozen=True)
    class Lopsided(Effect):
        id: ClassVar[str] = "lopsided"

        def dry(self, levels, speeds, state, p):
            return tuple((0.5 * backward, 2.0 * forward) for backward, forward in levels)

    robot = AXIS_ROBOT + Lopsided()  # levels 0.25 backwards and 1.0 forwards
    for force, moves in ((0.9, False), (1.1, True), (-0.2, False), (-0.3, True)):
        speed = simulated(robot, np.full((T, 1), force), Integrator(1))[-1, 0]
        final = (force - np.sign(force) * (1.0 if force > 0 else 0.25)) / 2.0
        if moves:
            assert speed == pytest.approx(final * (1 - np.exp(-2.0 * (T - 1) * DT)), rel=1e-6)
        else:
            assert abs(speed) < 1e-15
