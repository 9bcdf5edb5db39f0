"""The reduced triangle against the dense Jacobian of the whole problem, differentiated without it."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxid import Axis, LogSet
from jaxid.estimate.output_error.problem import Unknowns, cost, holding, linearise, parameters_at, simulate_all
from jaxid.estimate.output_error.setup import build
from jaxid.simulation.rollout import rollout

pytestmark = pytest.mark.usefixtures("double_precision")
LINEARISE, COST = (jax.jit(function, static_argnums=0) for function in (linearise, cost))


def dense(structure, problem, x):
    """Every weighted residual, one below the other; `x` is (states of all logs, z)."""
    E, s = problem.state_free.shape
    own, z = x[: E * s].reshape(E, s), x[E * s :]
    theta = jnp.where(problem.free, problem.bounds.physical(z), problem.held)
    p = {**problem.numbers, **dict(zip(structure.names, theta, strict=True))}
    rows = []
    for e in range(E):
        start = {name: problem.start[name][e] for name in structure.robot.states}
        for i, name in enumerate(structure.state_names):
            start[name] = start[name] + problem.state_scale[i] * own[e, i] * problem.state_free[e, i]
        y = rollout(structure.robot, p, start, problem.inputs[e], problem.dt[e], structure.integrator)
        rows.append((jnp.where(problem.mask[e], y - problem.outputs[e], 0.0) / problem.sigma).ravel())
        pull = jnp.sqrt(problem.state_precision) * problem.state_scale * own[e]
        rows.append(pull * problem.state_free[e])
    rows.append(jnp.sqrt(problem.prior_precision) * (theta - problem.prior_mean) * problem.free)
    return jnp.concatenate(rows)


def assembled(triangle):
    """The triangle's blocks as one matrix over (states of all logs, z), and its residual."""
    E, s, n = triangle.crossed.shape
    matrix = np.zeros((E * s + n, E * s + n))
    for e in range(E):
        rows = slice(e * s, (e + 1) * s)
        matrix[rows, rows] = triangle.local[e]
        matrix[rows, E * s :] = triangle.crossed[e]
    matrix[E * s :, E * s :] = triangle.shared
    return matrix, np.concatenate([np.ravel(triangle.residual_local), triangle.residual_shared])


def test_cost_gradient_and_gauss_newton_matrix_are_those_of_the_dense_problem(problem):
    structure, numbers, unknowns = problem
    assert structure.state_names == ("q", "v")
    np.testing.assert_array_equal(numbers.state_free, [[False] * 2, [False] * 2, [True] * 2])
    x = jnp.concatenate([unknowns.states.ravel(), unknowns.z])
    residual = jax.jit(lambda x: dense(structure, numbers, x))
    r, jacobian = np.asarray(residual(x)), np.asarray(jax.jit(jax.jacfwd(lambda x: dense(structure, numbers, x)))(x))
    triangle = LINEARISE(structure, numbers, unknowns)
    matrix, reduced = assembled(triangle)
    assert float(triangle.cost) == pytest.approx(0.5 * r @ r, rel=1e-12)
    assert float(COST(structure, numbers, unknowns)) == pytest.approx(0.5 * r @ r, rel=1e-12)
    gradient = jacobian.T @ r
    np.testing.assert_allclose(matrix.T @ reduced, gradient, atol=1e-9 * np.abs(gradient).max())
    normal = jacobian.T @ jacobian
    np.testing.assert_allclose(matrix.T @ matrix, normal, atol=1e-9 * np.abs(normal).max())
    # the sums of squares by channel count the measurements that exist, and nothing else
    data = [np.asarray(residual(x))[: 2 * 256].reshape(256, 2)]
    np.testing.assert_allclose(triangle.squares[0], (data[0] ** 2).sum(axis=0), rtol=1e-12)
    assert float(triangle.squares[1, 1]) == 0.0  # no position there


def test_a_parameter_that_is_not_free_stays_and_has_no_sensitivity(problem):
    structure, numbers, unknowns = problem
    assert float(parameters_at(numbers, unknowns.z)[3]) == 0.05
    moved = Unknowns(unknowns.z + np.array([0.0, 0.0, 0.0, 7.0]), unknowns.states)
    triangle, same = LINEARISE(structure, numbers, unknowns), LINEARISE(structure, numbers, moved)
    assert np.all(np.asarray(triangle.shared)[:, 3] == 0.0)
    np.testing.assert_array_equal(triangle.residual_shared, same.residual_shared)


def test_what_is_masked_does_not_count_whatever_stands_there(problem):
    structure, numbers, unknowns = problem
    garbage = jnp.where(numbers.mask, numbers.outputs, jnp.nan)
    triangle = LINEARISE(structure, replace(numbers, outputs=garbage), unknowns)
    same = LINEARISE(structure, numbers, unknowns)
    np.testing.assert_array_equal(triangle.residual_shared, same.residual_shared)
    assert np.isfinite(float(triangle.cost))
    assert COST(structure, replace(numbers, outputs=garbage), unknowns) == COST(structure, numbers, unknowns)


def test_a_simulation_that_diverges_costs_a_lot_but_is_a_number(problem):
    structure, numbers, unknowns = problem
    light = holding(numbers, 0, 1e-9)  # 1 ng of mass
    assert not bool(jnp.all(jnp.isfinite(simulate_all(structure, light, unknowns))))
    triangle = LINEARISE(structure, light, unknowns)
    assert all(bool(jnp.all(jnp.isfinite(part))) for part in triangle if part is not triangle.squares)
    assert float(triangle.cost) > 1e12 * float(LINEARISE(structure, numbers, unknowns).cost)


def test_build_refuses_a_robot_without_free_parameters(axis_log):
    from jaxid import ParameterError

    robot = Axis().with_parameters(Axis().parameters.with_free())
    with pytest.raises(ParameterError, match="no parameter is free; free at least one"):
        build(robot, LogSet([axis_log("a", np.repeat([1.0, -1.0], 25))]), start={})
