"""Other optimisers in the place of jaxid's own, and whole fits under jit and vmap."""

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
import pytest

import jaxid
from jaxid import Axis, Integrator, LogSet, Outcome, output_error
from jaxid.estimate.output_error.setup import build
from jaxid.estimate.output_error.solvers import minimise_compiled

STEP = Integrator(2)


@pytest.fixture(scope="module")
def logs(axis_log):
    inputs = np.repeat(np.random.default_rng(3).uniform(-2, 2, 25), 10)
    return LogSet([axis_log("a", inputs, 0.02, 1, position=False, Fc=0.3)])


@pytest.fixture(scope="module")
def fit(logs):
    return output_error(Axis(), logs, integrator=STEP)


@pytest.mark.parametrize("solver", [optx.LevenbergMarquardt(1e-8, 1e-8), optx.Dogleg(1e-8, 1e-8)], ids=["lm", "dogleg"])
def test_solvers_of_optimistix_reach_the_same_optimum(logs, fit, solver):
    other = output_error(Axis(), logs, integrator=STEP, solver=solver)
    assert other.converged
    for name in fit.free_names:
        assert abs(other[name].value - fit[name].value) < 0.05 * fit[name].std_error, name
        assert other[name].std_error == pytest.approx(fit[name].std_error, rel=0.02)


def test_a_search_may_end_where_no_more_than_so_much_is_promised(logs):
    with jaxid.float64():
        structure, problem, start = build(Axis(), logs, start={}, integrator=STEP)
        one, near, there = (minimise_compiled(structure, problem, start, until=u) for u in (np.inf, 0.05, 0.0))
    assert int(one.iterations) == 1 and np.array_equal(one.unknowns.z, start.z)
    assert 1 < int(near.iterations) < int(there.iterations)
    assert float(there.cost) <= float(near.cost) < float(there.cost) + 0.1


@pytest.mark.slow
def test_whole_fits_run_under_jit_and_vmap_and_give_what_output_error_gives(logs, fit):
    rng = np.random.default_rng(4)
    with jaxid.float64():
        problem, start = jaxid.output_error_problem(Axis(), logs, integrator=STEP)
        clean = np.asarray(problem.arrays.outputs)
        noisy = jnp.asarray(clean + 0.02 * rng.normal(size=(3, *clean.shape)))
        found = jax.jit(jax.vmap(lambda y: jaxid.minimise(problem.with_outputs(y), start)))(noisy)
        found, noisy = jax.tree.map(np.asarray, (found, noisy))
    assert problem.names == fit.free_names
    for k in range(3):
        samples = len(logs[0])
        log = jaxid.Log.from_arrays("a", logs[0].time, logs[0].inputs, noisy[k, 0, :samples], "axis")
        outputs = np.where(np.isfinite(logs[0].outputs), log.outputs, np.nan)
        log = jaxid.Log.from_arrays("a", log.time, log.inputs, outputs, "axis")
        alone = output_error(Axis(), LogSet([log]), integrator=STEP, covariance="white")
        assert int(found.outcome[k]) == Outcome.OPTIMUM
        for i, name in enumerate(problem.names):
            assert abs(found.parameters[k, i] - alone[name].value) < 0.02 * alone[name].std_error, name
            assert np.sqrt(found.covariance[k, i, i]) == pytest.approx(alone[name].std_error, rel=0.01)
        assert float(found.noise[k, 0]) == pytest.approx(alone.noise["v"], rel=0.005)


def test_a_loss_of_ones_own_takes_the_place_of_a_name(logs):
    class Mine(jaxid.Huber):
        k: float = 1.345

    mine, named = (output_error(Axis(), logs, integrator=STEP, loss=loss) for loss in (Mine(), "huber"))
    assert mine["M"].value == named["M"].value
    with pytest.raises(ValueError, match="no loss 'hubert'; use squares, huber"):
        output_error(Axis(), logs, integrator=STEP, loss="hubert")
