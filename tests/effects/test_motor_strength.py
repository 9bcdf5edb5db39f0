"""Motors of other strength: the torque constant, which is the back-EMF's, too, on robots of which no winding is known."""

import numpy as np
import pytest

from jaxid import DifferentialDrive, EffectError, Log, LogSet, Omni, simulate
from jaxid.effects import effect_by_id, laws_of
from jaxid.effects.actuator.motor_strength import TorqueConstantOfTorques


def driven(robot):
    random, n = np.random.default_rng(5), 200
    inputs = np.repeat(random.uniform(-12.0, 12.0, (n // 20, 2)), 20, axis=0)
    logs = LogSet([Log.from_arrays("one", 0.02 * np.arange(n), inputs, np.zeros((n, 2)), robot)])
    return simulate(robot, logs)[0]


def with_gains(robot, *gains):
    robot = robot + effect_by_id(robot, "motor_gain_mismatch", "torque_and_back_emf")
    names = [name for name in robot.parameters if name.startswith("motor_gain_mismatch.")]
    return robot.with_values(**dict(zip(names, gains, strict=True)))


@pytest.fixture
def robot():
    return DifferentialDrive().with_values(M=12.0, J=0.4, Fv=4.0, Fc=3.0, gain=2.0, back_emf=8.0)


def test_all_motors_stronger_are_the_robot_with_another_gain_and_back_emf(robot):
    both = driven(robot.with_values(gain=2.0 * 0.94, back_emf=8.0 * 0.94))
    np.testing.assert_allclose(driven(with_gains(robot, -0.06, -0.06)), both, rtol=1e-9, atol=1e-12)
    assert np.max(np.abs(driven(with_gains(robot, -0.06, 0.0)) - both)) > 1e-3


def test_only_where_torques_fall_with_the_speed_and_no_winding_is_known(robot):
    assert "torque_and_back_emf" in [law.law for law in laws_of(robot, "motor_gain_mismatch")]
    assert "torque_and_back_emf" not in [law.law for law in laws_of(Omni(), "motor_gain_mismatch")]
    with pytest.raises(EffectError, match="another gain"):
        robot.with_values(back_emf=0.0) + TorqueConstantOfTorques()
    with pytest.raises(EffectError, match="windings of 'omni' are known"):
        Omni() + TorqueConstantOfTorques()


@pytest.mark.parametrize(
    ("gains", "is_one"),
    [
        ((-0.84, -0.2, 0.0), False),
        ((-0.5, -0.12, -0.05), False),
        ((-0.2, -0.15, -0.1), True),
        ((0.0, -0.1, -0.4), True),
    ],
)
def test_a_motor_that_lacks_only_small_commands_has_a_dead_zone(gains, is_one):
    """What it loses of 1 V is most of it, and of 10 V no more volts than that."""
    model = Omni() + effect_by_id(Omni(), "motor_gain_mismatch", "shape")
    name = model.channels.inputs[1]
    heights = {f"motor_gain_mismatch.at_{k}_{name}": gain for k, gain in enumerate(gains, start=1)}
    model = model.with_values(**heights)
    (curve,) = model.effects
    assert curve.agrees(model) is is_one and curve.rather == "actuator_dead_zone"
