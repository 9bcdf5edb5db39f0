"""Curves one height of which other parameters can do as well, on an axis in closed form."""

import numpy as np
import pytest

from jaxid import Axis
from jaxid.effects import effect_by_id
from jaxid.explanation.held_heights import with_heights_held
from jaxid.explanation.refit import refit
from jaxid.simulation.scaled import scaled_to
from tests.explanation import closed_form_axis
from tests.explanation.closed_form_axis import driven

SEED = 4
NOISE = {"v": closed_form_axis.NOISE}


def with_curve(logs, held_out, known):
    """The axis and a curve of what is lost of its command, all heights free, refitted."""
    robot = scaled_to(Axis().with_values(M=1.0, Fv=2.0, Fc=0.0, offset=0.0), logs)
    for name in ("Fc", "offset", *known):
        robot = robot.change(name, free=False)
    robot = robot + effect_by_id(robot, "voltage_saturation", "shape")
    start = {name: robot.parameters[name].value for name in robot.parameters.free_names}
    return refit(robot, [start], logs, held_out, NOISE, {})


def limited(u):
    return 3.0 * np.tanh(u / 3.0)


def test_of_a_scale_that_nobody_sees_one_height_is_held():
    logs, held_out = driven(limited, SEED)
    trial = with_curve(logs, held_out, known=())
    held = with_heights_held(trial, logs, held_out, NOISE)
    fixed = [name for name, p in held.robot.parameters.items() if ".at_" in name and not p.free]
    assert fixed == ["voltage_saturation.at_1"] and held.robot.parameters[fixed[0]].value == 0.0
    assert held.free == trial.free - 1 and held.squares < trial.squares + 5.0
    # What is measured of the motion now says what moves: the same, but for the scale that the held height chooses.
    assert held.robot.parameters["Fv"].value / held.robot.parameters["M"].value == pytest.approx(2.0, rel=0.02)


def test_a_height_that_something_needs_stays_free():
    logs, held_out = driven(lambda u: np.sign(u) * np.maximum(np.abs(u) - 0.8, 0.0), SEED)
    trial = with_curve(logs, held_out, known=("M", "Fv"))
    assert with_heights_held(trial, logs, held_out, NOISE) is trial


def test_a_model_without_curves_is_left_alone():
    logs, held_out = driven(limited, SEED)
    robot = scaled_to(Axis().with_values(M=1.0, Fv=2.0, Fc=0.0), logs)
    start = {name: robot.parameters[name].value for name in robot.parameters.free_names}
    trial = refit(robot, [start], logs, held_out, NOISE, {})
    assert with_heights_held(trial, logs, held_out, NOISE, pytest.fail) is trial
