"""The rivals of `benchmarks/fit.py` solve the same problem as jaxid: same model, same cost, same first step's worth."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxid import float64
from jaxid.estimate.output_error.problem import linearise

pytest.importorskip("numba")
from benchmarks.rivals import jaxid_fit, optimistix_fit, pioneer_numba  # noqa: E402
from benchmarks.rivals.pioneer_problem import SIGMA, FitProblem, make_problem  # noqa: E402
from benchmarks.rivals.scipy_fit import dense, structured  # noqa: E402


@pytest.fixture(scope="module")
def problem() -> FitProblem:
    """Two short logs."""
    return make_problem(seed=3, samples=120, experiments=2)


def point_of(problem: FitProblem) -> np.ndarray:
    """A point off the start, with casters turned and speeds that are not zero."""
    return problem.start_point + np.concatenate([np.zeros(7), np.tile([0.4, 0.2, -0.3], problem.experiments)])


def at(problem: FitProblem, x: np.ndarray):
    """jaxid's problem, with its unknowns at the common units' x."""
    structure, arrays, unknowns = jaxid_fit.built(problem)
    theta, states = problem.split(x)
    order = [jaxid_fit.FREE.index(name) for name in structure.names]
    z = arrays.bounds.coordinates(jnp.asarray(theta[order]))
    return structure, arrays, unknowns._replace(z=z, states=jnp.asarray(states) / arrays.state_scale)


def test_all_see_the_same_model_and_cost(problem):
    """The scalar loops are jaxid's rollout to rounding, and jaxid's reduced cost is the plain residual's."""
    x = point_of(problem)
    errors = pioneer_numba.residual(problem, x)
    with float64():
        plain = np.asarray(jax.jit(optimistix_fit.residual)(jnp.asarray(x), optimistix_fit.data_of(problem)))
        reduced = float(jax.jit(linearise, static_argnums=0)(*at(problem, x)).cost)
    np.testing.assert_allclose(errors * SIGMA.min(), plain * SIGMA.min(), rtol=0, atol=1e-9)  # m/s, rad/s
    assert reduced == pytest.approx(0.5 * float(errors @ errors), rel=1e-9)


def test_structured_differences_are_the_dense_ones(problem):
    """Ten directions hold what thirty-one do."""
    x = problem.start_point
    here = pioneer_numba.residual(problem, x)
    jacobian = pioneer_numba.structured_jacobian(problem, x)
    for column in range(len(x)):
        moved = x.copy()
        moved[column] += 1e-7
        expected = (pioneer_numba.residual(problem, moved) - here) / 1e-7
        np.testing.assert_allclose(jacobian[:, column], expected, rtol=0, atol=1e-12)


def test_a_step_of_scipy_goes_down_alike(problem):
    """One linearisation with either Jacobian: the same step, to the finite differences' accuracy."""
    one, other = dense(problem, max_linearisations=2), structured(problem, max_linearisations=2)
    start = np.sum(pioneer_numba.residual(problem, problem.start_point) ** 2)
    costs = [np.sum(pioneer_numba.residual(problem, r.x) ** 2) for r in (one, other)]
    assert costs[0] < start
    assert costs[1] == pytest.approx(costs[0], rel=1e-4)
