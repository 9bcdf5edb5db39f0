"""Sides of a line on the floor: the robot's own friction is that of the side on which it begins."""

import numpy as np
import pytest

from jaxid import DifferentialDrive, Log, LogSet, simulate
from jaxid.effects import effect_by_id
from jaxid.simulation.rollout import Integrator


def floor(law, Fc, Fv, **values):
    effect = effect_by_id(DifferentialDrive(), "surface_change", law)
    robot = (DifferentialDrive() + effect).with_values(Fc=Fc, Fv=Fv)
    return effect, robot.with_values(**{effect.key(name): value for name, value in values.items()})


@pytest.mark.parametrize("law", ["line", "gradual"])
def test_with_its_sides_exchanged_a_floor_is_the_same_floor(law):
    """And the friction that is the robot's own that of the other side, which is as much more as it was less."""
    effect, robot = floor(law, 1.5, 2.0, coulomb=-0.4, viscous=-0.2, angle=4.0, offset=-0.3, width=0.08)
    values = effect.sides_exchanged(robot, 0.0, 0.0)
    _, other = floor(law, 1.5 * 0.6, 2.0 * 0.8, width=0.08)
    other = other.with_values(**values)
    assert values[effect.key("offset")] == 0.3 and values[effect.key("coulomb")] == pytest.approx(1.0 / 0.6 - 1.0)
    time = 0.02 * np.arange(500)
    inputs = np.stack([4.0 * np.sin(time), 4.0 * np.sin(1.3 * time)], axis=1)
    logs = LogSet([Log.from_arrays("a", time, inputs, np.zeros((500, 2)), DifferentialDrive())])
    one, two, plain = (simulate(r, logs, integrator=Integrator(4))[0] for r in (robot, other, DifferentialDrive()))
    np.testing.assert_allclose(two, one, atol=1e-9)
    assert np.max(np.abs(one - plain)) > 0.01
    assert effect.sides_exchanged(other, 0.0, 0.0) == {}  # it begins where it should
