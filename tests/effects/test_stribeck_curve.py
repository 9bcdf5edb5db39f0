"""What a Stribeck curve may look like, and what the verdict makes of one that falls towards standstill."""

import pytest

from jaxid import Axis
from jaxid.effects import effect_by_id
from jaxid.effects.curve import SHAPE


def with_excess(*heights):
    law = effect_by_id(Axis(), "stribeck_friction", SHAPE)
    robot = Axis() + law
    return law, robot.with_values(**{law.key(f"at_{k + 1}"): height for k, height in enumerate(heights)})


@pytest.mark.parametrize(
    ("heights", "contrary"),
    [((3.0, 2.0, 1.0, 0.3), False), ((-0.2, 2.0, 1.0, 0.3), False), ((-3.0, -2.0, -1.0, -0.3), True)],
)
def test_friction_that_falls_towards_standstill_is_no_stribeck_friction(heights, contrary):
    """One height at standstill, of a curve that rises otherwise, is hardly known."""
    law, robot = with_excess(*heights)
    assert bool(law.doubt(robot)) == contrary
