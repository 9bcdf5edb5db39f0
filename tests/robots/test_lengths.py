"""jaxid/robots/lengths.py: the unit of length that a robot's forces and mass imply."""

import pytest

from jaxid import Omni
from jaxid.logs.units import metres_of
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
    assert Omni().length_unit == "m" and Omni().metre == 1.0


def test_every_length_that_a_force_implies_has_its_metres():
    assert [metres_of(unit) for unit in ("m", "mm", "cm", "um", "km")] == [1.0, 1e-3, 1e-2, 1e-6, 1e3]
    assert metres_of("rad") is None and metres_of("") is None
