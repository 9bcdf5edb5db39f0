"""jaxid/effects/ground/turning_friction.py: wheels that scrub stop a turn, and hold until they are turned harder."""

from dataclasses import replace

import numpy as np
import pytest

from jaxid import DifferentialDrive, Log, LogSet, Omni, simulate
from jaxid.effects import effect_by_id


@pytest.mark.parametrize("law", ["coulomb_and_viscous", "by_turn_radius", "fading_with_speed"])
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


@pytest.mark.parametrize("robot", [DifferentialDrive(), Omni()], ids=["differential", "omni"])
def test_a_scrub_that_fades_is_less_by_an_exponential_of_the_speed_whichever_way_it_goes(robot):
    model = robot + effect_by_id(robot, "turning_friction", "fading_with_speed")
    model = model.with_values(**{"turning_friction.coulomb": 0.3, "turning_friction.rolling": 0.5})
    turning = robot.turning
    for name in (own for own in robot.velocities if own != turning):
        for speed in (0.0, 0.5, -1.0):
            state = {own: np.float64(0.0) for own in robot.own_states} | {
                turning: np.float64(-2.0),
                name: np.float64(speed),
            }
            without, found = (
                m.rates(state, (0.0,) * len(m.channels.inputs), (0.0,) * len(m.rubbing(state, m.parameters.numbers)), p)
                for m, p in ((robot, robot.parameters.numbers), (model, model.parameters.numbers))
            )
            moment = robot.parameters.numbers["J"] * float(found[turning] - without[turning])
            assert moment == pytest.approx(0.3 * np.exp(-abs(speed) / 0.5), rel=1e-3)


@pytest.mark.parametrize(("heights", "resists"), [((0.4, 0.8, 1.0, 1.1), True), ((-2.0, -2.9, -3.0, -3.1), False)])
def test_a_moment_that_drives_is_friction_that_falls_once_the_robot_turns(heights, resists):
    """A robot with dry friction of its own against turning takes up the level: what is left of Stribeck friction drives."""
    robot = Omni() + effect_by_id(Omni(), "turning_friction", "shape")
    robot = robot.with_values(**{f"turning_friction.at_{k}": h for k, h in enumerate(heights, start=1)})
    (curve,) = robot.effects
    assert curve.agrees(robot) is resists and curve.rather == "stribeck_friction"
    assert bool(curve.doubt(robot)) is not resists
