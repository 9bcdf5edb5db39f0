"""Logs that the model explains one by one and not together, on an axis in closed form that rubs more in some of them."""

import numpy as np
import pytest

from jaxid import AXIS, Axis, Log, LogSet, explain, output_error
from jaxid.explanation.left.between_logs import changed_between

ROBOT = Axis().with_values(M=1.0, Fv=2.0, Fc=0.0, offset=0.0).change("Fc", free=False).change("offset", free=False)


def recorded(frictions, law=lambda u: u):
    """Speeds of an axis without dry friction, of another viscous friction in every log."""
    logs = []
    for k, friction in enumerate(frictions):
        rng = np.random.default_rng([8, k])
        u = np.repeat(rng.uniform(-4, 4, 60), 10)
        decay, v, found = np.exp(-friction * 0.02), 0.0, []
        for force in law(u):
            found.append(v)
            v = force / friction + (v - force / friction) * decay
        outputs = {"v": np.array(found) + 0.003 * rng.normal(size=len(u))}
        logs.append(Log.from_arrays(f"run {k}", 0.02 * np.arange(len(u)), u[:, None], outputs, AXIS))
    return LogSet(logs[:-2]), LogSet(logs[-2:])


def quiet(message):
    """Nobody listens."""


@pytest.mark.slow
def test_logs_on_several_floors_are_told_and_no_effect_is_said_to_be_missing():
    logs, held_out = recorded([2.0, 2.6, 2.0, 3.4, 2.0, 2.6, 3.4])
    found = explain(output_error(ROBOT, logs), logs, held_out)
    assert found.verdict == "unexplained"
    said = found.sentence
    assert said.startswith(found.between_logs) and found.between_logs.startswith("Every log alone")
    assert "Fv is 2 ±" in said and "3.398 ± 0.002 N s/m in run 6" in said and "`explain_change`" in said
    assert not any(f"run {k}" in said for k in (1, 5))  # those in the middle of all


def test_logs_that_no_values_explain_are_not_said_to_differ():
    logs, held_out = recorded([2.0] * 5, lambda u: np.sign(u) * np.maximum(np.abs(u) - 0.8, 0.0))
    assert changed_between(output_error(ROBOT, logs), logs, held_out, quiet) == ""


def test_logs_of_one_robot_are_alike():
    logs, held_out = recorded([2.0] * 5)
    assert changed_between(output_error(ROBOT, logs), logs, held_out, quiet) == ""
    few = LogSet(list(logs)[:1])
    assert changed_between(output_error(ROBOT, few), few, LogSet(list(held_out)[:1]), quiet) == ""
