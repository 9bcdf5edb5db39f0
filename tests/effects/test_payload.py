"""Loads that a robot may have, and those that none has."""

import pytest

from jaxid import Axis
from jaxid.effects import laws_of


@pytest.mark.parametrize("law", ["from_a_moment", "leaking", "in_some_logs"])
def test_no_robot_loses_all_of_its_own_mass(law):
    robot = Axis().with_values(M=1.0)
    effect = next(own for own in laws_of(robot, "payload_change") if own.law == law)
    model = robot + effect
    assert effect.doubt(model.with_values(**{effect.key("mass"): -0.6})) == ""
    assert (
        effect.doubt(model.with_values(**{effect.key("mass"): -1.76}))
        == "of a robot of M 1 kg no load of -1.76 kg is left"
    )
