"""The pictures of the mechanisms show what their formulas say."""

import numpy as np
import pytest

from benchmarks.fingerprints.__main__ import as_svg, picture
from benchmarks.fingerprints.cases import AXIS, CASES, DRIVE, OMNI
from jaxid.effects.catalogue import MECHANISMS

GAIN = AXIS.parameters["gain"].value

# What is missing, or wrong, by the mechanism's formula, over what the picture is drawn over.
EXPECTED = {
    "actuator_dead_zone": lambda u: -GAIN * np.clip(u, -1.5, 1.5),
    "voltage_saturation": lambda u: GAIN * (np.clip(u, -6.0, 6.0) - u),
    "quadratic_drag": lambda v: -8.0 * v * np.abs(v),
    "coulomb_friction": lambda v: -3.0 * np.sign(v),
    "stribeck_friction": lambda v: -3.0 * np.exp(-((v / 0.06) ** 2)) * np.sign(v),
    "traction_limit": lambda f: np.clip(f, -9.0, 9.0) - f,
    "asymmetric_viscous_friction": lambda v: -0.6 * AXIS.parameters["Fv"].value * np.abs(v),
    "asymmetric_friction": lambda v: np.full(len(v), -2 * 0.5 * DRIVE.parameters["Fc"].value),
    "input_delay": lambda since: np.where(since < 0.08 - 1e-9, -GAIN, 0.0),
    "cogging_torque": lambda way: 3.0 * np.sin(20.0 * way),
    "coriolis_coupling": lambda product: OMNI.parameters["M"].value * product,
    "steering_delay": lambda since: np.where(since < 0.08 - 1e-9, -1.0, 0.0),
    "steering_error": lambda u: np.tan(u + 0.05) - np.tan(u),
    "sensor_bias": lambda v: np.full(len(v), 0.05),
    "sensor_cross_talk": lambda w: 0.08 * w,
}


def test_every_mechanism_has_a_case():
    assert set(CASES) == {laws[0].id for laws in MECHANISMS}


@pytest.mark.parametrize("name", EXPECTED)
def test_what_is_missing_is_what_the_formula_says(name):
    """At nine moments of ten: in the others a command or the dry friction turns round within the sample."""
    x, y = CASES[name].seen(CASES[name].run(name))
    there = np.isfinite(y)
    assert there.sum() > 30
    off = np.abs(y - EXPECTED[name](x))[there]
    assert np.quantile(off, 0.9) < 0.06 * np.max(np.abs(y[there])), np.quantile(off, [0.5, 0.8, 0.9, 0.95])


def test_a_picture_is_the_same_each_time():
    case = CASES["sensor_bias"]
    run = case.run("sensor_bias")
    assert as_svg(picture(case, run), "sensor_bias") == as_svg(picture(case, run), "sensor_bias")
