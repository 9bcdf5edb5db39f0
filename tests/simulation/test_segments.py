"""Sensitivities a stretch of time after the other against those of the whole rollout at once."""

import numpy as np
import pytest

from jaxid import Log, LogSet, Pioneer, float64
from jaxid.estimate.output_error import direct as module
from jaxid.estimate.output_error.direct import log_triangles, sensitivities_directly, slopes_at
from jaxid.estimate.output_error.laid_out import direct
from jaxid.estimate.output_error.problem import DIVERGED, parameters_at
from jaxid.estimate.output_error.setup import build
from jaxid.simulation import segments


def problem_of(logs: int, samples: int = 250):
    """Logs of different lengths, some samples of which were not measured."""
    random, robot, found = np.random.default_rng(4), Pioneer(), []
    for k in range(logs):
        T = samples - 30 * (k % 3)
        inputs = np.repeat(random.uniform(-8, 8, (T // 10, 2)), 10, axis=0)
        outputs = 0.3 * random.normal(size=(len(inputs), 2))
        outputs[20:25, k % 2] = np.nan
        found.append(Log.from_arrays(f"log {k}", 0.02 * np.arange(len(inputs)), inputs, outputs, robot))
    start = {name: 1.1 * robot.parameters[name].value for name in robot.parameters.free_names}
    return build(robot, LogSet(found), start=start, initial="estimate")


@pytest.mark.parametrize("logs", [1, 3, 9])  # many, a few, and no segments side by side
def test_stretches_of_time_change_nothing(logs, monkeypatch):
    with float64():
        structure, problem, unknowns = problem_of(logs)
        d = direct(structure, problem)
        assert d is not None
        z, states = np.asarray(unknowns.z), np.asarray(unknowns.states) + 0.1
        theta, slope = parameters_at(d.problem, z), slopes_at(d.problem, z)
        R, squares = log_triangles(d, theta, slope, states)
        residual, jacobian = sensitivities_directly(d, theta, states)
        monkeypatch.setattr(module, "_MOST_ALONE", 0)
        monkeypatch.setattr(module, "_LONG", 0)
        monkeypatch.setattr(segments, "_SAMPLES", 40)
        found, own = log_triangles(d, theta, slope, states)
        left, by = sensitivities_directly(d, theta, states)
    for a, b in ((found, R), (own, squares), (left, residual), (by, jacobian)):
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-11 * np.max(np.abs(b)))


def test_a_log_that_diverges_spoils_no_other(monkeypatch):
    monkeypatch.setattr(module, "_MOST_ALONE", 0)
    monkeypatch.setattr(module, "_LONG", 0)
    monkeypatch.setattr(segments, "_SAMPLES", 40)
    with float64():
        structure, problem, unknowns = problem_of(2)
        d = direct(structure, problem)
        assert d is not None
        z, states = np.tile(unknowns.z, (2, 1)), np.asarray(unknowns.states)
        theta, slope = parameters_at(d.problem, z), slopes_at(d.problem, z)
        sound, _ = log_triangles(d, theta, slope, states)
        theta[1] = np.inf  # each log may have parameters of its own
        R, squares = log_triangles(d, theta, slope, states)
    np.testing.assert_array_equal(R[0], sound[0])
    assert not np.isfinite(squares[1]).all() and R[1, -1, -1] >= DIVERGED
