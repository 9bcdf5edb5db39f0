"""PySINDy beside the blind study: a hidden drag of known size comes out as the term that it is."""

import numpy as np
import pytest

pytest.importorskip("pysindy", reason="PySINDy is in the extra `benchmarks`")

import jaxid
from benchmarks.sindy.model import library
from benchmarks.sindy.readings import read
from benchmarks.sindy.regression import Setting, identify
from jaxid.explanation.left.heldout import held_out_state
from jaxid.robots.axis import Axis
from reference.axis import AXIS
from reference.logs import simulate_log

M, GAIN, FV, FC, DRAG, NOISE = 20.0, 10.0, 20.0, 8.0, 60.0, 0.002


def logs_with_drag(count: int, seed: int) -> jaxid.LogSet:
    """Random levels on a drive axis with a drag that `Axis` lacks."""
    reference = AXIS.with_parameters(J=M, k=GAIN, Cv=FV, Cs=FC)
    logs = []
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        inputs = np.repeat(rng.uniform(-4, 4, 16), 25)[:, None].round(2)
        hidden = {"quadratic_drag": {"coefficient": DRAG}}
        table = simulate_log(reference, inputs, 0.02, (NOISE,), seed + number, effects=hidden, rtol=1e-7, atol=1e-9)
        measured = np.column_stack([table["v"], np.full(len(table), np.nan)])
        logs.append(
            jaxid.Log.from_arrays(f"drag_{number}", table["t"].to_numpy(), inputs[: len(table)], measured, jaxid.AXIS)
        )
    return jaxid.LogSet(logs)


def test_drag_is_found_as_the_odd_square_of_the_speed():
    """With the true constants the residual acceleration is -DRAG v|v| / M; the held-out error falls to the noise."""
    robot = Axis().with_values(M=M, gain=GAIN, Fv=FV, Fc=FC)
    held_out = logs_with_drag(2, 50)
    found = identify(robot, logs_with_drag(3, 10), held_out, Setting(), {"v": NOISE})
    assert [term for _, term in found.coefficients] == ["s|s|"]
    coefficient = found.coefficients["v", "s|s|"]
    np.testing.assert_allclose(coefficient, -DRAG / M, rtol=0.05)
    assert read(library(robot)["s|s|"], "v", coefficient) == ("quadratic_drag",)
    # With all terms at zero the robot is the one that was given.
    np.testing.assert_allclose(
        found.before.normalised_rms, held_out_state(robot, held_out, {"v": NOISE}).normalised_rms, rtol=1e-9
    )
    assert found.before.normalised_rms > 5
    assert found.after.normalised_rms < 1.1
