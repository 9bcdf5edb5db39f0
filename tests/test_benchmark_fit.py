"""The rivals of `benchmarks/fit.py` solve the same problem as jaxid: same model, same cost, same first step's worth."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxid import float64
from jaxid.estimate.output_error.problem import linearise

pytest.importorskip("numba")
from benchmarks.rivals import cpp_fit, jaxid_fit, optimistix_fit, pioneer_numba  # noqa: E402
from benchmarks.rivals.other_robots import OtherProblem, omni_problem, pendulum_problem  # noqa: E402
from benchmarks.rivals.pioneer_problem import SIGMA, FitProblem, make_problem  # noqa: E402
from benchmarks.rivals.scipy_fit import dense, structured  # noqa: E402
from benchmarks.rivals.targets import targets  # noqa: E402


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


@pytest.mark.slow
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


@pytest.mark.slow
@pytest.mark.skipif(cpp_fit.absent() is not None, reason="no g++")
@pytest.mark.parametrize("kind", ["scalar", "simd"])
def test_cpp_sees_the_same_cost_and_slopes(problem, kind):
    """Blocks and gradients are those of the finite differences, to their accuracy."""
    x, task = point_of(problem), cpp_fit.pioneer_task(problem, kind)
    errors, jacobian = pioneer_numba.residual(problem, x), pioneer_numba.structured_jacobian(problem, x)
    cost, blocks, gradients = task.linearise(x)
    assert task.cost(x) == pytest.approx(cost, rel=1e-13) == 0.5 * float(errors @ errors)
    gradient = np.concatenate([gradients[:, 3:].sum(axis=0), gradients[:, :3].ravel()])
    expected = jacobian.T @ errors
    np.testing.assert_allclose(gradient, expected, atol=1e-5 * np.abs(expected).max())
    np.testing.assert_allclose(
        blocks[:, 3:, 3:].sum(axis=0), (jacobian.T @ jacobian)[:7, :7], atol=1e-5 * np.abs(blocks).max()
    )


@pytest.mark.slow
@pytest.mark.skipif(cpp_fit.absent() is not None, reason="no g++")
@pytest.mark.parametrize("make", [omni_problem, pendulum_problem])
def test_cpp_ends_where_jaxid_does_on_other_robots(make):
    """A whole fit, the same optimum to a thousandth of a standard error."""
    from jaxid.estimate.output_error.solvers import minimise_compiled

    other: OtherProblem = make(2, 400)
    task = other.task("scalar")
    x, _ = task.fit(other.start_point())
    with float64():
        structure, arrays, unknowns = other.built()
        optimum = minimise_compiled(structure, arrays, unknowns)
        own = other.point_of(structure, arrays, optimum.unknowns)
    assert task.cost(own) == pytest.approx(task.cost(x), abs=1e-3)


@pytest.mark.slow
def test_casadi_sees_the_same_cost_and_slopes(problem):
    """Its generated C against the scalar loops."""
    casadi_fit = pytest.importorskip("benchmarks.rivals.casadi_fit")
    pytest.importorskip("casadi")
    x = point_of(problem)
    np.testing.assert_allclose(casadi_fit.residual(problem, x), pioneer_numba.residual(problem, x), atol=1e-9)
    jacobian, expected = casadi_fit.jacobian(problem, x), pioneer_numba.structured_jacobian(problem, x)
    np.testing.assert_allclose(jacobian, expected, atol=1e-4 * np.abs(expected).max())


def test_what_is_met_is_computed_and_only_at_the_same_optimum():
    def row(name, ratio, cost):
        return {"name": name, "ratio": ratio, "cost": cost}

    structured_, dense_, casadi = (
        "SciPy trf, structured differences, numba",
        "SciPy trf, dense differences, numba",
        "CasADi generated C, SciPy trf",
    )
    spent = {"jaxid": 10.0, "C++, scalar": 39.0, "C++, simd": 8.4}
    results = {
        "rows": [
            row("jaxid", 1.0, 100.0),
            row(structured_, 12.0, 100.3),
            row(dense_, 20.0, 99.8),
            row(casadi, 9.0, 99.0),
        ],
        "linearisations": [
            {"robot": "pioneer", "experiments": 8, "ways": {k: {"processor_ms": v} for k, v in spent.items()}}
        ],
        "small_fits": [
            {"way": way, "fits": 4, "fits_per_processor_second": rate}
            for way, rate in (("jaxid", 30.0), ("C++, scalar", 10.0))
        ],
        "scaling": [{"experiments": E, "us_per_experiment_sample": us} for E, us in ((1, 9.0), (8, 1.0), (16, 1.31))],
    }
    found = {met.figure: met.verdict for met in targets(results, 0.5)}
    assert [verdict.split(":")[0] for verdict in found.values()] == [
        "not met",  # 3.9 x
        "met",  # 1.19 x
        "met",
        "not met",
        "not met",  # it found a lower cost
        "met",
        "not met",
    ]
