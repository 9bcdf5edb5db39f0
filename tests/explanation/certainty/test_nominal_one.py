"""jaxid/explanation/certainty/nominal_one.py: what would be of the robot's numbers if another motor were the nominal one."""

import numpy as np
import pytest
from scipy import signal

from jaxid import DifferentialDrive, Log, LogSet, explain, output_error

TRUTH = {"M": 11.0, "J": 0.4, "Fv": 6.0}
LEVER, GAIN = 0.2, 2.0
NOISE = 0.01


def answer(mass, resistance, gain, forces):
    """The speed of a mass with viscous friction alone under forces that are held between samples: exact."""
    kept = np.exp(-resistance / mass * 0.02)
    return signal.lfilter([0.0, gain / resistance * (1.0 - kept)], [1.0, -kept], forces)


def recorded(right, left, seed, name):
    """A robot whose motors are so many times as strong as its table says; no dry friction, so that its motion is linear."""
    random = np.random.default_rng(seed)
    volts = np.repeat(random.uniform(-6, 6, (20, 2)), 30, axis=0)
    forces = volts * [right, left]
    v = answer(TRUTH["M"], 2 * TRUTH["Fv"], GAIN, forces.sum(axis=1))
    w = answer(TRUTH["J"], 2 * LEVER**2 * TRUTH["Fv"], GAIN * LEVER, forces[:, 0] - forces[:, 1])
    outputs = np.stack([v, w], axis=1) + NOISE * random.normal(size=(len(v), 2))
    robot = DifferentialDrive()
    return Log(name, 0.02 * np.arange(len(v)), volts, outputs, robot.channels)


@pytest.mark.slow
@pytest.mark.parametrize(
    "strengths", [pytest.param((1.04, 0.96), marks=pytest.mark.slow), (0.93, 1.0)], ids=["both", "one"]
)
def test_the_robots_own_numbers_hold_the_truth_whichever_motor_is_the_nominal_one(strengths):
    fit, held_out = (LogSet([recorded(*strengths, 10 * k + i, f"{k}{i}") for i in range(3)]) for k in range(2))
    robot = DifferentialDrive().with_values(b=LEVER, gain=GAIN, Fc=0.0).change("Fc", free=False)
    story = explain(output_error(robot, fit), fit, held_out)
    assert [effect.id for effect in story.effects] == ["motor_gain_mismatch"] and story.verdict == "named"
    (said,) = [note for note in story.notes if "is nominal" in note]
    assert "M " in said and "J " in said
    for name, true in TRUTH.items():
        estimate = story.final[name]
        # Of the strengths themselves the data tells the ratio alone: up to 8 % of either is a convention.
        assert abs(estimate.value - true) < 2.0 * estimate.std_error < 0.2 * true, name
