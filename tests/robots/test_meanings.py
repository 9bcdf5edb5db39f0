"""jaxid/robots/meanings.py: a parameter is told by its table, an effect's by its law."""

import jaxid
from jaxid.effects import effect_by_id
from jaxid.robots.meanings import meanings_of


def test_parameters_of_effects_are_told_by_their_law():
    robot = jaxid.Axis()
    robot += effect_by_id(robot, "stribeck_friction")
    told = meanings_of(robot)
    assert told["M"] == "moving mass (inertia)"
    assert told["stribeck_friction.amplitude"].startswith("Stribeck friction: C' = C + amplitude")
    assert set(told) == set(robot.parameters)
