"""An axis on a slope, in closed form: where it is only driven up, the slope is friction, and that is said."""

import numpy as np
import pytest

from jaxid import Axis, LogSet, explain, output_error
from jaxid.estimate.output_error.one_way import one_way

USUAL = Axis().with_values(M=1.0, Fv=2.0, Fc=0.5)
ROBOT = USUAL.with_parameters(USUAL.parameters.change("offset", free=False))
HILL = 0.4


def runs(axis_log, lowest, position=False):
    logs = []
    for k in range(4):
        inputs = np.repeat(np.random.default_rng(k).uniform(lowest, 9.0, 25), 20)
        logs.append(
            axis_log(f"run {k}", inputs, noise=0.01, seed=k, position=position, M=1.3, Fv=2.0, Fc=0.5, offset=-HILL)
        )
    return LogSet(logs[:2]), LogSet(logs[2:])


@pytest.mark.parametrize("position", [False, True])
def test_what_drives_one_way_only_does_not_tell_friction_from_a_slope(axis_log, position):
    logs, held_out = runs(axis_log, 3.0, position)
    fit = output_error(ROBOT, logs)
    assert (
        abs(fit["Fc"].value - (0.5 - HILL)) < 5 * fit["Fc"].std_error
    )  # the hill pushes, and is taken for less friction
    (said,) = (note for note in fit.notes if "drives one way" in note)
    assert "Fc holds whatever else pushes alike" in said
    story = explain(fit, logs, held_out)
    assert said in story.notes and said.split(":")[0] in " ".join(str(story).split())


def test_of_logs_that_go_both_ways_nothing_is_said(axis_log):
    logs, _ = runs(axis_log, -9.0)
    fit = output_error(USUAL, logs)
    assert fit["Fc"].status == "identified"
    assert not any("drives one way" in note for note in fit.notes) and one_way(fit, logs) == ""


def test_friction_and_a_constant_force_are_not_told_apart_by_driving_one_way(axis_log):
    """Whatever the curvature says where the robot just sticks."""
    for seed in range(3):
        inputs = np.repeat(np.abs(np.random.default_rng(seed).uniform(-5.0, 5.0, 15)), 20)
        logs = LogSet(
            [axis_log("run", inputs, noise=0.03, seed=seed, position=False, M=1.3, Fv=2.0, Fc=0.7, offset=0.1)]
        )
        fit = output_error(USUAL, logs)
        assert {fit[name].status for name in ("Fc", "offset")} == {"not_identifiable"}
        assert fit["M"].status == "identified" and abs(fit["M"].value - 1.3) < 4 * fit["M"].std_error
        assert any(
            "Fc and offset push alike" in note or "one by one" in note or "hardly rises" in note for note in fit.notes
        )
