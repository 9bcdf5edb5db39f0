"""jaxid/robots/lengths.py: the unit of length that a robot's forces and mass imply."""

import pytest

from jaxid import Omni
from jaxid.robots.lengths import accelerated


@pytest.mark.parametrize(
    "force, mass, length",
    [
        ("N", "kg", "m"),
        ("mN", "kg", "mm"),
        ("mN", "g", "m"),
        ("uN", "g", "mm"),
        ("g mm/s^2", "g", "mm"),
        ("kg m/s^2", "kg", "m"),
        ("kg cm/s²", "kg", "cm"),
        ("N", "lb", "m"),
        ("N m", "kg", "m"),
        ("", "", "m"),
    ],
)
def test_the_length_that_a_force_accelerates_a_mass_by(force, mass, length):
    assert accelerated(force, mass) == length


def test_the_robots_of_this_package_are_in_metres():
    assert Omni().length_unit == "m"
