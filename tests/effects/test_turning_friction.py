"""jaxid/effects/ground/turning_friction.py: wheels that scrub stop a turn, and hold until they are turned harder."""

from dataclasses import replace

import numpy as np
import pytest

from jaxid import DifferentialDrive, Log, LogSet, Omni, simulate
from jaxid.effects import effect_by_id


@pytest.mark.parametrize("law", ["coulomb_and_viscous", "by_turn_radius"])
def test_a_turn_ends_where_dry_friction_ends_it(law):
    """1 kg m² against 1 N m: 2 N m for 2 s give 2 rad/s, which last for another 2 s; 0.8 N m then turn nothing at all."""
    time = 0.02 * np.arange(301)
    moment = np.select([time < 2.0, time < 4.5], [2.0, 0.0], 0.8)
    exact = np.select([time < 2.0, time < 4.0], [time, 4.0 - time], 0.0)
    robot = DifferentialDrive()
    robot = replace(robot, scales=replace(robot.scales, outputs={"v": 1.0, "w": 2.0}))
    known = {"M": 1.0, "J": 1.0, "b": 0.5, "Fv": 0.0, "Fc": 0.0, "turning_friction.coulomb": 1.0}
    model = (robot + effect_by_id(robot, "turning_friction", law)).with_values(**known)
    log = Log.from_arrays("turn", time, np.column_stack([moment, -moment]), np.zeros((301, 2)), model)
    (found,) = simulate(model, LogSet([log]))
    np.testing.assert_allclose(found[:, 1], exact, atol=0.015)


@pytest.mark.parametrize(("heights", "resists"), [((0.4, 0.8, 1.0, 1.1), True), ((-2.0, -2.9, -3.0, -3.1), False)])
def test_a_moment_that_drives_is_friction_that_falls_once_the_robot_turns(heights, resists):
    """A robot with dry friction of its own against turning takes up the level: what is left of Stribeck friction drives."""
    robot = Omni() + effect_by_id(Omni(), "turning_friction", "shape")
    robot = robot.with_values(**{f"turning_friction.at_{k}": h for k, h in enumerate(heights, start=1)})
    (curve,) = robot.effects
    assert curve.agrees(robot) is resists and curve.rather == "stribeck_friction"
    assert bool(curve.doubt(robot)) is not resists
