"""What a first look tries of an effect whose author says nothing about it."""

from dataclasses import dataclass
from typing import ClassVar

import pytest

from jaxid import Effect, Omni, Parameter, Pioneer
from jaxid.effects import catalogue, laws_of
from jaxid.robots.probe import Seen

SEEN = Seen(12.0, 20.0, lambda: None, lambda by_torque: ((), 0))


@dataclass(frozen=True)
class SlowDrop(Effect):
    """A strength, a time constant that has its typical value, and a constant of the robot, freed."""

    id: ClassVar[str] = "slow_drop"
    where: ClassVar[str] = "actuator"

    def parameters(self, robot):
        return {
            self.key("strength"): Parameter(0.0, "V", free=True, typical=0.4),
            self.key("gain"): Parameter(1.0, "", free=True, typical=1.1),
            self.key("time_constant"): Parameter(2.5, "s", free=True, typical=2.5),
        }

    def frees(self, robot):
        return ("M",)


def test_a_parameter_that_has_its_typical_value_is_a_shape_and_no_strength():
    robot = Pioneer().with_values(M=1.0) + SlowDrop()
    (probe,) = SlowDrop().probes(robot, SEEN)
    assert probe.shape == {"slow_drop.time_constant": 2.5}
    assert probe.strengths == {"slow_drop.strength": 0.4, "slow_drop.gain": 1.1, "M": pytest.approx(1.05)}


@pytest.mark.parametrize("robot", [Pioneer(), Omni()], ids=lambda robot: robot.name)
def test_every_strength_of_the_catalogue_changes_something(robot):
    # Where a strength is what the parameter is already, rounding alone would tell the two simulations apart.
    for effect in (law for own in catalogue(robot) for law in laws_of(robot, own.id)):
        there = robot + effect
        for probe in effect.probes(there, SEEN):
            same = [name for name, value in probe.strengths.items() if value == there.parameters[name].value]
            assert not same, (effect.title, same)
