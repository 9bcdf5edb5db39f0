"""jaxid/effects/actuator/motor_cross_talk.py: the commands of other motors, added in shares."""

import numpy as np
import pytest

from jaxid import Axis, DifferentialDrive, Log, LogSet, simulate
from jaxid.effects import effect_by_id
from jaxid.effects.actuator.motor_cross_talk import MotorCrossTalk
from jaxid.robots.traits import refusal


@pytest.mark.parametrize("law", ["proportional", "shape"])
def test_a_leak_is_the_same_as_commands_mixed_beforehand(law):
    robot = DifferentialDrive().with_values(M=10.0, J=0.4, Fv=3.0, Fc=1.0, b=0.2, gain=1.5, back_emf=4.0)
    effect = effect_by_id(robot, "motor_cross_talk", law)
    if law == "shape":
        shares = {f"motor_cross_talk.at_{k}": 0.1 for k in (1, 2, 3)}
        mixed = np.array([[1.0, 0.1], [0.1, 1.0]])
    else:
        shares = {"motor_cross_talk.share_u_right_of_u_left": 0.2, "motor_cross_talk.share_u_left_of_u_right": -0.1}
        mixed = np.array([[1.0, 0.2], [-0.1, 1.0]])
    commands = np.repeat(np.random.default_rng(3).uniform(-10, 10, (10, 2)), 30, axis=0)
    time, idle = 0.02 * np.arange(300), np.zeros((300, 2))
    (leaking,) = simulate(
        (robot + effect).with_values(**shares), LogSet([Log.from_arrays("leak", time, commands, idle, robot)])
    )
    (plain,) = simulate(robot, LogSet([Log.from_arrays("mixed", time, commands @ mixed.T, idle, robot)]))
    np.testing.assert_allclose(leaking, plain, atol=1e-9)


def test_one_motor_gets_nothing_of_others():
    assert "more than one drive input" in str(refusal(MotorCrossTalk(), Axis()))
