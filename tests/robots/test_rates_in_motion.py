"""jaxid/robots/rates_in_motion.py against an axis' equation of motion written out."""

import numpy as np
import pytest

from jaxid import Axis
from jaxid._float64 import in_float64
from jaxid.robots.rates_in_motion import rates_in_motion


@pytest.mark.parametrize(("mass", "dry"), [(2.0, 0.7), (3e-3, 40.0)])
def test_dry_friction_is_against_the_motion_of_every_state(mass, dry):
    robot = Axis().with_values(M=mass, Fv=1.5, Fc=dry, offset=0.0, back_emf=0.0)
    v, u = np.array([0.4, -0.3, 2.0]), np.array([1.0, 1.0, -4.0])
    states = {"v": v, **{name: np.zeros(3) for name in robot.initial_state() if name != "v"}}
    found = in_float64(rates_in_motion)(robot, ("v",), states, (u,), dict(robot.parameters.numbers))
    gain = robot.parameters["gain"].value
    np.testing.assert_allclose(np.asarray(found)[:, 0], (gain * u - 1.5 * v - dry * np.sign(v)) / mass, rtol=1e-12)
