"""The omni paper's methods on arrays: exact where there is no noise, honest where there is."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxid.estimate.result import Estimate
from jaxid.papers.mean import mean_of
from jaxid.papers.omni import tables as omni_tables
from jaxid.papers.omni.methods import (
    coast_down_friction,
    coast_down_inertia,
    hanging_inertia,
    steady_state_friction,
)
from jaxid.papers.omni.printed import TABLE_1, TABLE_6

M = 35.0


def coast(viscous, coulomb, mass, start, dt=0.02):
    """Exact coast-down to just before standstill."""
    ratio = coulomb / viscous
    stop = mass / viscous * np.log(1 + start / ratio)
    t = np.arange(0, stop, dt)
    return t, (start + ratio) * np.exp(-viscous / mass * t) - ratio


@pytest.mark.parametrize("sign", [1, -1])
def test_steady_state_takes_either_direction(sign):
    speed = sign * np.array([0.5, 0.9, 1.3])
    found = steady_state_friction(speed, 2.0 * speed + 20.0 * np.sign(speed), "Vn")
    assert (found.viscous.value, found.coulomb.value) == (pytest.approx(2.0), pytest.approx(20.0))


@pytest.mark.parametrize("sign", [1, -1])
def test_coast_down_recovers_friction_and_inertia_without_noise(sign):
    runs = [(t, sign * v) for t, v in (coast(3.73, 29.45, M, 1.4), coast(3.73, 29.45, M, 0.9))]
    found = coast_down_friction(runs, M, "V")
    assert found.viscous.value == pytest.approx(3.73, rel=1e-4)
    assert found.coulomb.value == pytest.approx(29.45, rel=1e-5)
    differences = coast_down_friction(runs, M, "V", differentiate=True)
    assert differences.viscous.value == pytest.approx(3.73, rel=0.01)  # Euler: first order in the sampling interval
    w = np.linspace(0.6, 1.2, 4)
    friction = steady_state_friction(w, 0.73 * w + 5.12, "W")
    t, W = coast(0.73, 5.12, 1.374, 4.0)
    assert coast_down_inertia([(t, sign * W)], friction).J.value == pytest.approx(1.374, rel=1e-4)
    assert coast_down_inertia([(t, sign * W)], friction, differentiate=True).J.value == pytest.approx(1.374, rel=0.01)


def test_differentiating_noisy_speeds_inflates_viscous_friction_and_integrating_does_not():
    """800 coast-downs with 0.01 m/s of noise: bias and scatter against the standard errors that are reported."""
    rng = np.random.default_rng(7)
    t, v = coast(3.73, 29.45, M, 1.4)
    integral, euler = [], []
    for _ in range(800):
        run = [(t, v + 0.01 * rng.standard_normal(len(t)))]
        integral.append(coast_down_friction(run, M, "V"))
        euler.append(coast_down_friction(run, M, "V", differentiate=True).viscous.value)
    values = np.array([found.viscous.value for found in integral])
    claimed = np.array([found.viscous.std_error for found in integral])
    standard_error = values.std() / np.sqrt(len(values))
    assert abs(values.mean() - 3.73) < 4 * standard_error
    assert values.std() / claimed.mean() == pytest.approx(1.0, abs=0.1)
    covered = [found.viscous.ci95[0] < 3.73 < found.viscous.ci95[1] for found in integral]
    assert np.mean(covered) == pytest.approx(0.95, abs=0.025)
    # A noisy sample v_k lowers v_(k+1) - v_k and raises v_k: slope error M sigma^2 / (dt var v), upwards.
    expected = M * 0.01**2 / (0.02 * v.var())
    assert np.mean(euler) - 3.73 == pytest.approx(expected, rel=0.2)
    assert expected > 0.8


def test_hanging_robot_recovers_inertia_with_honest_errors():
    rng = np.random.default_rng(9)
    t = np.arange(0, 4.5, 0.02)
    torque = 0.51 * 9.8 * 0.25
    theta = 1.0 + 0.1 * t + 0.5 * torque / 1.374 * t**2
    found = [hanging_inertia(t, theta + 0.01 * rng.standard_normal(len(t)), 0.51).J for _ in range(400)]
    values = np.array([J.value for J in found])
    assert values.mean() == pytest.approx(1.374, abs=4 * values.std() / 20)
    assert values.std() / np.mean([J.std_error for J in found]) == pytest.approx(1.0, abs=0.12)
    assert hanging_inertia(t, theta, 0.51, differentiate=True).J.value == pytest.approx(1.374, rel=1e-9)
    assert hanging_inertia(t, -theta, 0.51).J.value == pytest.approx(1.374, rel=1e-9)  # turning the other way


def test_falling_mass_makes_the_papers_inertia_too_large_by_its_own():
    """The wire pulls with m (g - r dW/dt); taking it for m g adds m r^2 to J."""
    J, m, r, g = 1.374, 1.0, 0.25, 9.8
    t = np.linspace(0, 3, 151)
    fall = solve_ivp(lambda _, y: [y[1], m * r * (g - r * (m * g * r / (J + m * r**2))) / J], (0, 3), [0, 0], t_eval=t)
    found = hanging_inertia(t, fall.y[0], m)
    assert found.J.value == pytest.approx(J + m * r**2, rel=1e-6)
    assert found.without_mass is not None and found.without_mass.value == pytest.approx(J, rel=1e-6)
    # On the paper's own Table 4 this brings the mean, 1.3905, to 1.351: within one standard error (0.008, from the four
    # experiments' scatter) of methods 1+2's 1.358, from which the paper's own 1.3905 is about four away.
    corrected = np.array(omni_tables.table_4().column("without it")[:4], float)
    scatter = corrected.std(ddof=1) / 2
    assert corrected.mean() == pytest.approx(1.3510, abs=5e-5) and scatter == pytest.approx(0.008, abs=5e-4)
    assert abs(corrected.mean() - TABLE_6["Methods 1+2"]) < scatter < abs(1.3905 - TABLE_6["Methods 1+2"]) / 3.9


def test_mean_of_estimates():
    mean = mean_of([Estimate.of(1.0, 0.3, "N"), Estimate.of(2.0, 0.4, "N")])
    assert (mean.value, mean.std_error) == (pytest.approx(1.5), pytest.approx(0.25))


@pytest.mark.parametrize(
    "call, words",
    [
        (lambda: steady_state_friction([1.0, 1.1], [3.0, 4.0]), "2 measurement"),
        (lambda: steady_state_friction([1.0, 1.0, 1.0], [3.0, 4.0, 3.5]), "vary the speed"),
        (lambda: steady_state_friction([1.0, 0.0, 2.0], [3.0, 4.0, 5.0]), "zero at point 1"),
        (lambda: steady_state_friction([1.0, np.nan, 2.0], [3.0, 4.0, 5.0]), "speed.* sample 1"),
        (lambda: steady_state_friction([1.0, 2.0, 3.0], [3.0, 4.0]), "one length"),
        pytest.param(
            lambda: steady_state_friction([1.0, 2.0, 3.0], [3.0, 4.0, 5.0], "Y"),  # type: ignore[arg-type]
            "no axis 'Y'",
            marks=pytest.mark.wrong_types,
        ),
        (lambda: coast_down_friction([], M), "no runs"),
        (lambda: coast_down_friction([([0, 1, 1, 2], [4, 3, 2, 1])], M), "run 0.*increasing"),
        (lambda: coast_down_inertia([], steady_state_friction(*TABLE_1["V"], "V")), "friction of W"),
        (lambda: hanging_inertia([0, 1, 2, 3, 4], [0, 1, 4, 9, 16], -1.0), "mass = -1"),
        (lambda: mean_of([Estimate.of(1, 1, "N"), Estimate.of(1, 1, "kg")]), "one unit"),
    ],
)
def test_arrays_that_cannot_be_used(call, words):
    with pytest.raises(ValueError, match=words):
        call()
