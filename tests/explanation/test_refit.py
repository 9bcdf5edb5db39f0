"""A refit that runs away is a bad trial and no error: the others go on."""

import numpy as np
import pytest

import jaxid.explanation.refit as under_test
from jaxid import AXIS, Axis, Log, LogSet
from jaxid.explanation.refit import refit
from jaxid.logs import noise_scale


def recorded(axis_law, seed):
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(-4, 4, 30), 10)
    v = axis_law(u, 0.02)[0] + 0.003 * rng.normal(size=len(u))
    return LogSet([Log.from_arrays(f"run {seed}", 0.02 * np.arange(len(u)), u[:, None], {"v": v}, AXIS)])


@pytest.mark.parametrize("mass", [1e-12, float("nan")])
def test_a_model_that_cannot_be_simulated_is_as_bad_as_can_be(axis_law, monkeypatch, mass):
    logs, held_out = recorded(axis_law, 1), recorded(axis_law, 2)
    found = under_test.by_name
    monkeypatch.setattr(under_test, "by_name", lambda *given: {**found(*given), "M": mass})
    robot = Axis()
    start = {name: robot.parameters[name].value for name in robot.parameters.free_names}
    trial = refit(robot, [start], logs, held_out, noise_scale(held_out), {})
    assert trial.squares == trial.score == np.inf
    assert np.isfinite(trial.held_out.normalised_rms) and trial.robot.parameters["M"].value == start["M"]
