"""The filter's likelihood against the joint Gaussian density of all samples, written down without any filter."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.linalg import expm
from scipy.stats import multivariate_normal

from jaxid import AXIS, Axis, Integrator, Log, LogSet
from jaxid.estimate.prediction_error.likelihood import Unknowns, cost, flat, look
from jaxid.estimate.prediction_error.scoring import minimise, minimise_in_turns, minimise_lanes
from jaxid.estimate.prediction_error.setup import build

M, FV, Q, R_V, R_Q = 1.5, 3.0, 0.3, 0.02, 0.005


def discretised(interval):
    """Transition, input gain and process noise of (q, v) over an interval (Van Loan 1978)."""
    A = np.array([[0.0, 1.0], [0.0, -FV / M]])
    noise = np.diag([0.0, Q**2])
    block = expm(np.block([[-A, noise], [np.zeros((2, 2)), A.T]]) * interval)
    transition = block[2:, 2:].T
    held = expm(np.block([[A, np.array([[0.0], [1.0 / M]])], [np.zeros((1, 3))]]) * interval)
    return transition, held[:2, 2], transition @ block[:2, 2:]


def joint_density(log):
    """-log of the density of everything measured in a log that starts at rest: mean and covariance, all samples at once."""
    T = len(log.time)
    mean, covariance = np.zeros((T, 2)), np.zeros((2 * T, 2 * T))
    F = [discretised(interval) for interval in np.diff(log.time)]
    for k, (A, b, N) in enumerate(F):
        mean[k + 1] = A @ mean[k] + b * log.inputs[k, 0]
        old, new = slice(2 * k, 2 * k + 2), slice(2 * k + 2, 2 * k + 4)
        covariance[new, : 2 * k + 2] = A @ covariance[old, : 2 * k + 2]
        covariance[: 2 * k + 2, new] = covariance[new, : 2 * k + 2].T
        covariance[new, new] = A @ covariance[old, old] @ A.T + N
    swap = np.array([[0.0, 1.0], [1.0, 0.0]])  # the channels are v, q
    show = np.kron(np.eye(T), swap)
    covariance = show @ covariance @ show.T + np.kron(np.eye(T), np.diag([R_V**2, R_Q**2]))
    y = log.outputs.ravel()
    there = np.isfinite(y)
    expected = (mean @ swap.T).ravel()
    return -multivariate_normal.logpdf(y[there], expected[there], covariance[np.ix_(there, there)])


@pytest.fixture(scope="module")
def sampled():
    """Two logs of different lengths with uneven intervals and missing samples."""
    random = np.random.default_rng(4)
    logs = []
    for number, samples in enumerate((14, 9)):
        time = np.concatenate([[0.0], np.cumsum(random.uniform(0.005, 0.04, samples - 1))])
        outputs = {name: random.normal(scale=0.1, size=samples) for name in ("v", "q")}
        outputs["v"][0] = outputs["q"][0] = 0.0  # else the log is taken to start there
        outputs["v"][3] = outputs["q"][5] = outputs["q"][6] = np.nan
        logs.append(Log.from_arrays(str(number), time, random.normal(size=(samples, 1)), outputs, AXIS))
    return LogSet(logs)


def at_truth(logs, integrator=None):
    """The problem and its coordinates at the constants above."""
    from jaxid import float64

    with float64():
        robot = Axis().with_values(M=M, Fv=FV, Fc=0.0, offset=0.0)
        robot = robot.with_parameters(robot.parameters.with_free("M", "Fv"))
        task = build(robot, logs, start={"M": M, "Fv": FV}, initial="known", integrator=integrator)
        problem = replace(task.problem, process_reference=jnp.array([Q]), sensor_reference=jnp.array([R_V, R_Q]))
        x = flat(Unknowns(task.start.z, jnp.zeros(1), jnp.zeros(2)))
        return task._replace(problem=problem), x


@pytest.fixture(scope="module")
def task(sampled):
    return at_truth(sampled)


def test_the_likelihood_is_the_joint_density_of_all_samples(sampled, double_precision):
    """Of samples that the model would hardly ever give (squares of a hundred variances each), so steps must be short."""
    found, x = at_truth(sampled, Integrator(8))
    exact = sum(joint_density(log) for log in sampled)
    at = jax.jit(lambda x: cost(found.names, found.model, found.problem, x))
    assert float(at(x)) == pytest.approx(exact, abs=1e-4)
    # The density must be able to tell: a tenth more of any noise, or of the mass, changes it more than ten times as much.
    for i in range(5):
        assert abs(float(at(x.at[i].add(0.1))) - exact) > 0.01


def test_the_usual_steps_are_short_enough_for_the_process_noise(sampled, double_precision):
    """Of samples that the model gives, the likelihood is a thousand times closer than a standard error (one half)."""
    random, drawn = np.random.default_rng(6), []
    for log in sampled:
        state, outputs = np.zeros(2), np.zeros_like(log.outputs)
        for k, interval in enumerate(np.diff(log.time)):
            A, b, noise = discretised(interval)
            state = A @ state + b * log.inputs[k, 0] + random.multivariate_normal(np.zeros(2), noise)
            outputs[k + 1] = state[::-1] + random.normal(size=2) * [R_V, R_Q]
        drawn.append(Log.from_arrays(log.name, log.time, log.inputs, outputs, AXIS))
    logs = LogSet(drawn)
    found, x = at_truth(logs)
    exact = sum(joint_density(log) for log in logs)
    at = jax.jit(lambda x: cost(found.names, found.model, found.problem, x))
    assert float(at(x)) == pytest.approx(exact, abs=5e-4)


def test_the_gradient_is_that_of_the_likelihood(task, double_precision):
    found, x = task
    x = x + jnp.array([0.1, -0.2, 0.3, 0.2, -0.1])
    h = 1e-5
    at = jax.jit(lambda x: cost(found.names, found.model, found.problem, x))
    numeric = [float(at(x.at[i].add(h)) - at(x.at[i].add(-h))) / (2 * h) for i in range(5)]
    gradient = jax.jit(lambda x: look(found.names, found.model, found.problem, x).gradient)(x)
    np.testing.assert_allclose(gradient, numeric, rtol=1e-5, atol=1e-5)


def test_the_information_is_the_scatter_of_the_gradient(task, double_precision):
    """At the truth the gradient of realisations has mean zero and the information as its covariance."""
    found, x = task
    dt = np.asarray(found.problem.records.dt)
    there = np.asarray(found.problem.records.there)
    inputs = np.asarray(found.problem.records.inputs)
    E, T = dt.shape
    random, N = np.random.default_rng(1), 400
    outputs = np.zeros((N, E, T, 2))
    for e in range(E):
        state = np.zeros((N, 2))
        for k in range(there[e].any(axis=-1).nonzero()[0].max() + 1):
            outputs[:, e, k] = state[:, ::-1] + random.normal(size=(N, 2)) * [R_V, R_Q]
            A, b, noise = discretised(dt[e, k])
            state = state @ A.T + b * inputs[e, k, 0] + random.multivariate_normal(np.zeros(2), noise, N)

    def one(y):
        own = replace(found.problem, records=found.problem.records._replace(outputs=jnp.where(there, y, 0.0)))
        seen = look(found.names, found.model, own, x)
        return seen.gradient, seen.information

    gradients, information = map(np.asarray, jax.jit(lambda ys: jax.lax.map(one, ys))(jnp.asarray(outputs)))
    expected = information.mean(axis=0)
    root = np.linalg.cholesky(np.linalg.inv(expected))
    white = gradients @ root
    np.testing.assert_allclose(white.mean(axis=0), 0.0, atol=4 / np.sqrt(N))
    np.testing.assert_allclose(np.cov(white.T), np.eye(5), atol=5 * np.sqrt(2 / N))


def test_the_optimiser_can_be_traced(task, double_precision):
    """As under the user's own `jit` and `vmap`; what it finds is compared in the slow test below."""
    task, x = task
    found = jax.eval_shape(
        lambda start: minimise(task.names, task.model, task.problem, start, max_steps=3),
        jax.ShapeDtypeStruct(x.shape, x.dtype),
    )
    assert found.x.shape == x.shape


@pytest.mark.slow
def test_many_realisations_are_minimised_in_lanes_as_one_is_alone(task, sampled, double_precision):
    task, x = task
    names, model, problem = task.names, task.model, task.problem
    once = np.asarray(problem.records.outputs)
    outputs = jnp.asarray(np.stack([once, once[:, ::-1]]))
    starts = jnp.stack([x, x])
    lanes = minimise_lanes(names, model, problem, {"outputs": outputs}, starts, lanes=2, max_steps=3)
    for k in range(2):
        alone = replace(problem, records=problem.records._replace(outputs=outputs[k]))
        found = minimise_in_turns(names, model, alone, np.asarray(x), max_steps=3)
        np.testing.assert_allclose(lanes.x[k], found.x, rtol=1e-9, atol=1e-12)
