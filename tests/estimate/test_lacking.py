"""What a residual that asks for a force says of the model that leaves it."""

from types import SimpleNamespace

import numpy as np
import pytest

from jaxid import Axis
from jaxid.effects import effect_by_id
from jaxid.estimate.lacking import Neglected, ways_of, words_of


def said(words, effects):
    """Of a fit with these effects, whose one parameter would move by 4 of its errors."""

    class Fit(dict):
        free_names = ("M",)
        robot = SimpleNamespace(effects=effects)

    return Neglected(words, 6.0, 3e-7, np.array([0.4])).sentence(Fit(M=SimpleNamespace(std_error=0.1)))


@pytest.mark.parametrize(
    ("identifier", "asked"),
    [
        ("actuator_dead_zone", "inputs.dead_zone"),
        ("input_delay", "inputs.late"),
        ("sensor_delay", "inputs.late"),
        ("asymmetric_viscous_friction", "neglected_force.oneway_v"),
        ("quadratic_drag", "neglected_force.drag_v"),
        ("stribeck_friction", "neglected_friction.rise_0"),
    ],
)
def test_a_model_that_has_such_a_force_is_not_said_to_lack_it(identifier, asked):
    words = words_of(asked)
    effects = {name: effect_by_id(Axis(), name) for name in (identifier, "sensor_bias")}
    assert f"the mark of {words} (p = 3e-07), which the model does not have: with it M" in said(words, ())
    other = "sensor_bias"
    assert "which the model does not have" in said(words, (effects[other],))
    with_it = said(words, (effects[other], effects[identifier]))
    assert f"{words} (p = 3e-07), of another form or size than the model's: with it M would move by 4" in with_it


def test_inputs_are_not_asked_for_a_delay_by_a_model_whose_own_is_free():
    robot, late = Axis(), "inputs.late"
    assert late in ways_of(robot) and late in ways_of(robot + effect_by_id(robot, "sensor_lag"))
    for identifier, law, name in (("input_delay", "constant", "delay"), ("sensor_delay", "early", "lead")):
        shifted = robot + effect_by_id(robot, identifier, law)
        assert late not in ways_of(shifted) and "inputs.dead_zone" in ways_of(shifted)
        assert late in ways_of(shifted.change(f"{identifier}.{name}", free=False))
