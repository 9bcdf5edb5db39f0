"""jaxid/explanation/certainty/other_constants.py: a table that is wrong in one place is asked about the others."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import signal

from jaxid import DifferentialDrive, Log, LogSet, output_error
from jaxid.effects.table_constants import TableConstants
from jaxid.explanation.certainty.other_constants import likelier_constants

M, J, FV, LEVER, GAIN, NOISE = 11.0, 0.4, 6.0, 0.2, 2.0, 0.01


def answer(mass, resistance, gain, forces):
    """The speed of a mass with viscous friction alone under forces that are held between samples: exact."""
    kept = np.exp(-resistance / mass * 0.02)
    return signal.lfilter([0.0, gain / resistance * (1.0 - kept)], [1.0, -kept], forces)


def recorded(seed):
    random = np.random.default_rng(seed)
    volts = np.repeat(random.uniform(-6, 6, (20, 2)), 30, axis=0)
    v = answer(M, 2 * FV, GAIN, volts.sum(axis=1))
    w = answer(J, 2 * LEVER**2 * FV, GAIN * LEVER, volts[:, 0] - volts[:, 1])
    outputs = np.stack([v, w], axis=1) + NOISE * random.normal(size=(len(v), 2))
    return Log(f"run {seed}", 0.02 * np.arange(len(v)), volts, outputs, DifferentialDrive().channels)


@pytest.mark.parametrize("mass", [10.0, 11.0], ids=["a load aboard", "none"])
def test_a_mass_that_is_off_too_is_said_and_what_hangs_on_it(mass):
    logs = LogSet([recorded(seed) for seed in range(3)])
    known = DifferentialDrive().with_values(b=1.1 * LEVER, gain=GAIN, M=mass, Fc=0.0)
    robot = known.change("Fc", free=False).change("M", free=False) + TableConstants(("b",))
    fit = output_error(robot, logs)
    state = SimpleNamespace(noise={"v": NOISE, "w": NOISE}, diverged=False)
    found = SimpleNamespace(robot=fit.robot, angles=None, held_out=state)
    said = likelier_constants(found, fit, {"b": -1 / 11}, logs)
    if mass == M:
        assert not said
    else:
        assert said.startswith("b is hardly all that is wrong in the table") and "Fv by" in said
        assert "M (+" in said and "gain (-" in said  # which of the two, no log tells: both scale all forces
