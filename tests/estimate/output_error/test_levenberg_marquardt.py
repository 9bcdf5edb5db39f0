"""The optimiser against SciPy, linear least squares, and itself under jit and vmap."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import least_squares

from jaxid import Axis, Channels, Custom, Integrator, Log, LogSet, Parameter, float64
from jaxid.estimate.output_error import polish
from jaxid.estimate.output_error.bounds import Bounds
from jaxid.estimate.output_error.levenberg_marquardt import (
    UNDECIDED,
    BestDampingLevenbergMarquardt,
    begin,
    decided,
    tried,
)
from jaxid.estimate.output_error.optimum import Outcome
from jaxid.estimate.output_error.problem import Apart, Triangle, Unknowns, linearise, parameters_at, simulate_all
from jaxid.estimate.output_error.setup import build
from jaxid.estimate.output_error.solvers import minimise, minimise_compiled, minimise_lanes

pytestmark = pytest.mark.usefixtures("double_precision")


@pytest.fixture(scope="module")
def axis(axis_log):
    inputs = [np.repeat(np.random.default_rng(k).uniform(-2, 2, 20), 10) for k in range(3)]
    logs = LogSet([axis_log(f"{k}", u, noise=0.02, seed=k, offset=0.05) for k, u in enumerate(inputs)])
    with float64():
        return build(Axis(), logs, start=dict(M=1.4, Fv=1.3, Fc=0.3, offset=0.0), integrator=Integrator(2))


def test_the_optimum_is_scipys(axis):
    structure, problem, start = axis

    @jax.jit
    def residual(z):
        y = simulate_all(structure, problem, Unknowns(z, start.states))
        return jnp.where(problem.mask, (y - problem.outputs) / problem.sigma, 0.0).ravel()

    found = least_squares(residual, start.z, jac=jax.jit(jax.jacfwd(residual)), method="trf", xtol=1e-12, ftol=1e-14)
    optimum = minimise_compiled(structure, problem, start)
    assert bool(optimum.converged)
    assert float(optimum.cost) == pytest.approx(found.cost, rel=1e-9)
    theirs, ours = (np.asarray(parameters_at(problem, jnp.asarray(z))) for z in (found.x, optimum.unknowns.z))
    error = np.sqrt(np.diag(np.linalg.inv(found.jac.T @ found.jac))) * np.asarray(
        problem.bounds.slope(jnp.asarray(found.x))
    )
    assert np.all(np.abs(theirs - ours) < 0.01 * error)  # a hundredth of a standard error
    np.testing.assert_allclose(ours, [1.0, 2.0, 0.5, 0.05], atol=5 * error.max())


def test_the_returned_triangle_is_the_linearisation_at_the_optimum(axis):
    structure, problem, start = axis
    optimum = minimise_compiled(structure, problem, start)
    there = jax.jit(linearise, static_argnums=0)(structure, problem, optimum.unknowns)
    np.testing.assert_allclose(optimum.triangle.shared, there.shared, rtol=1e-8, atol=1e-6)
    np.testing.assert_allclose(optimum.triangle.squares, there.squares, rtol=1e-10)
    assert float(optimum.cost) == pytest.approx(float(there.cost), rel=1e-12)


def test_by_turns_nothing_is_compiled_and_the_optimum_is_that_of_the_pure_form(axis_log):
    """Any number of logs with initial states of their own."""
    rng = np.random.default_rng(2)
    logs = []
    for k in range(5):
        log = axis_log(f"{k}", np.repeat(rng.uniform(-2, 2, 12), 10), noise=0.02, seed=k, v=0.2 * k, q=1.0)
        logs.append(log)
    start = dict(M=1.4, Fv=1.3, Fc=0.3, offset=0.0)
    tasks = [build(Axis(), LogSet(logs[:E]), start=start, initial="estimate", integrator=Integrator(2)) for E in (2, 5)]
    compiled = []
    jax.monitoring.register_event_duration_secs_listener(lambda event, *_, **__: compiled.append(event))
    found = [minimise_compiled(*task) for task in tasks][-1]
    jax.monitoring.clear_event_listeners()
    assert not [event for event in compiled if "backend_compile" in event]
    assert bool(found.converged) and found.unknowns.states.shape == tasks[-1][2].states.shape
    pure = jax.jit(minimise, static_argnums=0)(*tasks[-1])
    error = np.sqrt(np.diag(np.linalg.inv(found.triangle.shared.T @ found.triangle.shared)))
    assert np.all(np.abs(np.asarray(pure.unknowns.z) - found.unknowns.z) < 1e-4 * error)
    np.testing.assert_allclose(found.unknowns.states, pure.unknowns.states, atol=1e-6)
    assert float(found.cost) == pytest.approx(float(pure.cost), rel=1e-10)


@pytest.mark.filterwarnings("ignore:overflow encountered")  # steps as far as the curve goes
@pytest.mark.slow
def test_one_decision_is_the_same_in_numpy_and_in_a_program():
    """Random linearisations, with and without initial states of their own, bounds, and columns that show nothing."""
    rng = np.random.default_rng(5)
    rule = BestDampingLevenbergMarquardt().rule
    for E, s, n in ((3, 2, 4), (1, 0, 5), (4, 1, 1)):
        shared = np.triu(rng.normal(size=(n, n))) * 10.0 ** rng.uniform(-3, 3, n)
        shared[:, -1] *= float(n != 5)
        triangle = Triangle(
            shared,
            rng.normal(size=(E, s, n)),
            np.triu(rng.normal(size=(E, s, s))) + 3.0 * np.eye(s),
            100.0 * rng.normal(size=n),
            100.0 * rng.normal(size=(E, s)),
            rng.normal(size=1),
            np.abs(rng.normal(size=(E, 1))),
        )
        bounds = Bounds(np.where(np.arange(n) % 2, -np.inf, 0.0), np.full(n, np.inf), np.full(n, 2.0))
        here = Unknowns(rng.uniform(0.0, 1.0, n), rng.normal(size=(E, s)))
        asked = bounds, np.ones(n, dtype=bool), begin(here, triangle), triangle
        plain = decided(rule, *asked, 100)
        program = jax.jit(lambda *asked: decided(rule, *asked, 100))(*asked)
        assert bool(plain.going) and bool(program.going)
        np.testing.assert_allclose(plain.state.promise, program.state.promise, rtol=1e-9)
        asked_for = plain.steps.asked
        np.testing.assert_array_equal(asked_for, program.steps.asked)
        np.testing.assert_allclose(plain.steps.shares, program.steps.shares)
        for ours, theirs in zip(plain.steps.candidates, program.steps.candidates, strict=True):
            np.testing.assert_allclose(ours[asked_for], theirs[asked_for], rtol=1e-8, atol=1e-9)
        nothing = Apart(np.full(plain.steps.known.own.shape, 1e9), np.zeros(plain.steps.known.shared.shape))
        shrunk, theirs = plain, program
        for _ in range(5):  # the other shares, shorter steps, and in the end all from the beginning
            shrunk, theirs = tried(shrunk, nothing), jax.jit(tried)(theirs, nothing)
            assert bool(shrunk.going) and bool(theirs.going)
            now_asked = shrunk.steps.asked
            np.testing.assert_array_equal(now_asked, theirs.steps.asked)
            for ours, other in zip(shrunk.steps.candidates, theirs.steps.candidates, strict=True):
                np.testing.assert_allclose(ours[now_asked], other[now_asked], rtol=1e-8, atol=1e-9)
        shrunk, theirs = tried(shrunk, nothing), jax.jit(tried)(theirs, nothing)
        assert not bool(shrunk.going) and not bool(theirs.going)
        assert int(shrunk.state.outcome) == int(theirs.state.outcome) == Outcome.NO_PROGRESS
        good = nothing._replace(own=np.zeros(nothing.own.shape))
        taken, theirs = tried(plain, good), jax.jit(tried)(program, good)
        np.testing.assert_allclose(taken.state.there.z, plain.steps.candidates.z[0])
        for name in ("there", "radius", "shares", "outcome", "stalled", "least"):
            pair = (jax.tree.leaves(getattr(one.state, name)) for one in (taken, theirs))
            for ours, other in zip(*pair, strict=True):
                np.testing.assert_allclose(ours, other, rtol=1e-8, atol=1e-9)


def test_every_experiment_takes_its_own_share_of_a_step():
    """Where the whole step is good for one experiment and bad for another, each gets what is good for it."""
    rng = np.random.default_rng(3)
    E, s, n = 3, 1, 2
    triangle = Triangle(
        np.triu(rng.normal(size=(n, n))) + 3.0 * np.eye(n),
        rng.normal(size=(E, s, n)),
        np.full((E, s, s), 2.0),
        0.1 * rng.normal(size=n),
        rng.normal(size=(E, s)),
        np.zeros(1),
        np.ones((E, 1)),
    )
    bounds = Bounds(np.full(n, -np.inf), np.full(n, np.inf), np.ones(n))
    here = Unknowns(np.zeros(n), np.zeros((E, s)))
    search = decided(
        BestDampingLevenbergMarquardt().rule, bounds, np.ones(n, bool), begin(here, triangle), triangle, 100
    )
    steps = search.steps
    assert steps.asked.sum() == 1 and steps.asked[0]  # the usual share, along the straight line
    found = Apart(np.full(steps.known.own.shape, 1e9), np.zeros(steps.known.shared.shape))
    search = tried(search, found)
    k = len(steps.shares)
    assert search.steps.asked[:k].tolist() == [False] + [True] * (k - 1)
    best = [1, 3, 2]
    found.own[best, range(E)] = 0.0
    state = tried(search, found).state
    np.testing.assert_array_equal(state.there.z, steps.candidates.z[0])
    np.testing.assert_array_equal(state.there.states, steps.candidates.states[best, range(E)])
    np.testing.assert_array_equal(state.shares, steps.shares[best, range(E)])


def test_a_step_that_is_good_for_all_and_bad_for_one_is_looked_at_again():
    n, E, s = 1, 3, 1
    triangle = Triangle(
        np.eye(n), np.zeros((E, s, n)), np.ones((E, s, s)), np.ones(n), np.ones((E, s)), np.zeros(1), np.ones((E, 1))
    )
    bounds = Bounds(np.full(n, -np.inf), np.full(n, np.inf), np.ones(n))
    start = begin(Unknowns(np.zeros(n), np.zeros((E, s))), triangle)
    for before, again in ((0.0, True), (np.inf, False)):  # nothing is known of the costs before the first step
        state = start._replace(own=np.full(E, before))
        search = decided(BestDampingLevenbergMarquardt().rule, bounds, np.ones(n, bool), state, triangle, 100)
        found = Apart(np.full(search.steps.known.own.shape, 1e9), np.zeros(search.steps.known.shared.shape))
        found.own[:: len(search.steps.shares)] = -50.0, -50.0, 20.0
        search = tried(search, found)
        assert bool(search.going) == again and (search.state.outcome == UNDECIDED)
        if again:
            found.own[2] = 0.0
            search = tried(search, found)
        np.testing.assert_array_equal(search.state.own, [-50.0, -50.0, 0.0 if again else 20.0])


def test_steps_next_to_a_minimum_are_extrapolated_to_where_they_end():
    """Each direction keeps its own share of what is left: as many steps as directions, and one more, show where all end."""
    rng = np.random.default_rng(7)
    n, E, s = 3, 2, 1
    triangle = Triangle(
        np.triu(rng.normal(size=(n, n))) + 3.0 * np.eye(n),
        rng.normal(size=(E, s, n)),
        np.full((E, s, s), 2.0),
        np.zeros(n),
        np.zeros((E, s)),
        np.zeros(1),
        np.ones((E, 1)),
    )
    end = Unknowns(rng.normal(size=n), rng.normal(size=(E, s)))
    off = [(share, Unknowns(rng.normal(size=n), rng.normal(size=(E, s)))) for share in (0.8, -0.3, 0.1)]

    def at(k, directions):
        z = end.z + sum(share**k * by.z for share, by in off[:directions])
        return Unknowns(z, end.states + sum(share**k * by.states for share, by in off[:directions]))

    for directions in (1, 2, 3):
        steps = polish.no_steps(at(0, directions))
        for k in range(directions):
            found = polish.extrapolated(triangle, at(k, directions), at(k + 1, directions), steps)
            assert np.abs(found.z - end.z).max() > 1e-3  # not known yet
            steps = polish.with_step(steps, at(k, directions), at(k + 1, directions))
        found = polish.extrapolated(triangle, at(directions, directions), at(directions + 1, directions), steps)
        np.testing.assert_allclose(found.z, end.z, atol=1e-10)
        np.testing.assert_allclose(found.states, end.states, atol=1e-10)
        program = jax.jit(polish.extrapolated)(
            triangle, at(directions, directions), at(directions + 1, directions), steps
        )
        np.testing.assert_allclose(program.z, end.z, atol=1e-10)


def test_steps_that_show_no_end_are_not_extrapolated():
    triangle = Triangle(
        np.eye(1), np.zeros((1, 0, 1)), np.zeros((1, 0, 0)), *(np.zeros(k) for k in (1, (1, 0), 1)), np.ones((1, 1))
    )
    places = [Unknowns(np.array([x]), np.zeros((1, 0))) for x in (0.0, 1.0, 1.99)]  # ever on
    steps = polish.with_step(polish.no_steps(places[0]), places[0], places[1])
    found = polish.extrapolated(triangle, places[1], places[2], steps)
    np.testing.assert_array_equal(found.z, places[2].z)


@pytest.fixture(scope="module")
def linear():
    """y = a u1 + b u2 + c u1 u2: no dynamics, so that least squares has a closed form."""
    channels = Channels(inputs=("u1", "u2"), outputs=("y",))
    robot = Custom(
        dynamics=lambda state, u, p: {"nothing": 0.0 * state["nothing"]},
        state_names=("nothing",),
        own_channels=channels,
        table={name: Parameter(1.0, free=True) for name in "abc"},
        output=lambda state, u, p: {"y": p["a"] * u["u1"] + p["b"] * u["u2"] + p["c"] * u["u1"] * u["u2"]},
    )
    rng = np.random.default_rng(8)
    inputs = rng.normal(size=(120, 2))
    matrix = np.column_stack([inputs, inputs[:, 0] * inputs[:, 1]])
    y = matrix @ [0.7, -2.0, 0.1] + 0.1 * rng.normal(size=120)
    log = Log.from_arrays("linear", 0.1 * np.arange(120), inputs, y[:, None], channels)
    with float64():
        structure, problem, start = build(robot, LogSet([log]), start={}, initial="known", integrator=Integrator(1))
        problem = replace(problem, sigma=jnp.array([0.1]))
    return structure, problem, start, matrix, y


def test_on_a_linear_problem_one_gauss_newton_step_is_linear_least_squares(linear):
    structure, problem, start, matrix, y = linear
    triangle = jax.jit(linearise, static_argnums=0)(structure, problem, start)
    step = np.linalg.solve(np.asarray(triangle.shared), -np.asarray(triangle.residual_shared))
    expected, squares, *_ = np.linalg.lstsq(matrix, y)
    np.testing.assert_allclose(parameters_at(problem, start.z + step), expected, rtol=1e-10)
    optimum = minimise_compiled(structure, problem, start)
    np.testing.assert_allclose(parameters_at(problem, optimum.unknowns.z), expected, rtol=1e-6)
    assert float(optimum.cost) == pytest.approx(0.5 * squares[0] / 0.1**2, rel=1e-10)
    assert int(optimum.iterations) <= 8


def test_priors_pull_as_the_closed_form_says(linear):
    structure, problem, start, matrix, y = linear
    mean, deviation = np.array([1.0, 0.0, 0.5]), np.array([0.01, np.inf, 0.02])
    pulled = replace(problem, prior_mean=jnp.asarray(mean), prior_precision=jnp.asarray(deviation**-2.0))
    optimum = minimise_compiled(structure, pulled, start)
    precision = np.diag(deviation**-2.0)
    normal = matrix.T @ matrix / 0.1**2 + precision
    expected = np.linalg.solve(normal, matrix.T @ y / 0.1**2 + precision @ mean)
    np.testing.assert_allclose(parameters_at(pulled, optimum.unknowns.z), expected, rtol=1e-6)
    shared = np.asarray(optimum.triangle.shared)
    np.testing.assert_allclose(shared.T @ shared, normal, rtol=1e-9, atol=1e-9 * normal.max())


@pytest.mark.slow
def test_many_starts_in_one_batch_are_the_single_fits_and_a_diverging_one_harms_nobody(axis):
    structure, problem, start = axis
    shifts = jnp.array([[0.0, 0.0, 0.0, 0.0], [0.5, -0.4, 0.3, 0.1], [-40.0, 3.0, 0.0, 0.0]])
    starts = Unknowns(start.z + shifts, jnp.broadcast_to(start.states, (3, *start.states.shape)))
    outputs = jax.jit(simulate_all, static_argnums=0)(structure, problem, Unknowns(starts.z[2], start.states))
    assert not bool(jnp.all(jnp.isfinite(outputs)))  # a mass of 2.5e-6 kg explodes
    lanes = minimise_lanes(structure, problem, starts)
    for k in range(2):
        single = minimise_compiled(structure, problem, Unknowns(starts.z[k], start.states))
        np.testing.assert_allclose(lanes.unknowns.z[k], single.unknowns.z, atol=1e-6)
        assert float(lanes.cost[k]) == pytest.approx(float(single.cost), rel=1e-10)
        assert bool(lanes.converged[k])
    assert bool(jnp.all(jnp.isfinite(lanes.cost))) and bool(jnp.all(jnp.isfinite(lanes.unknowns.z)))
    assert float(lanes.cost[2]) > 1e6 * float(lanes.cost[0])
    assert bool(lanes.diverged[2]) and not bool(lanes.converged[2])
    assert not bool(lanes.diverged[0])


def test_a_step_into_divergence_is_rejected():
    """The whole Gauss-Newton step leads to where nothing is finite: the optimiser must turn back."""
    channels = Channels(inputs=("u",), outputs=("y",))
    robot = Custom(
        dynamics=lambda state, u, p: {"nothing": 0.0 * state["nothing"]},
        state_names=("nothing",),
        own_channels=channels,
        table={"a": Parameter(0.01, free=True)},
        output=lambda state, u, p: {"y": u["u"] * jnp.log(p["a"])},  # not a number for a < 0
    )
    u = np.random.default_rng(9).normal(size=(60, 1))
    log = Log.from_arrays("pole", 0.1 * np.arange(60), u, u * np.log(0.002), channels)
    options = dict(start=dict(a=0.02), initial="known", integrator=Integrator(1))
    structure, problem, start = build(robot, LogSet([log]), **options)
    problem = replace(problem, sigma=jnp.array([0.1]))
    triangle = jax.jit(linearise, static_argnums=0)(structure, problem, start)
    full = start.z - triangle.residual_shared / triangle.shared[0]
    assert float(parameters_at(problem, full)[0]) < 0  # where Gauss-Newton would go
    optimum = minimise_compiled(structure, problem, start)
    assert bool(optimum.converged)
    assert float(parameters_at(problem, optimum.unknowns.z)[0]) == pytest.approx(0.002, rel=1e-4)


@pytest.mark.slow
def test_a_batch_of_data_sets_is_fitted_as_each_alone(axis):
    structure, problem, start = axis
    noise = jnp.asarray(np.random.default_rng(5).normal(size=(2, *problem.outputs.shape))) * problem.sigma

    def fit(outputs):
        return minimise(structure, replace(problem, outputs=outputs), start).unknowns.z

    together = jax.jit(jax.vmap(fit))(problem.outputs + noise)
    for k in range(2):
        alone = minimise_compiled(structure, replace(problem, outputs=problem.outputs + noise[k]), start)
        np.testing.assert_allclose(together[k], alone.unknowns.z, atol=1e-6)
