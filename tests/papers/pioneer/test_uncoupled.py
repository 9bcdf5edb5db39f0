"""Equations 34 and 35 on runs that show one motion, and equation 31 as printed, against independent simulations."""

import numpy as np
import pytest

from jaxid import Log, LogError, Pioneer, demo, read_logs
from jaxid.effects.body import QuadraticDrag
from jaxid.papers.pioneer.uncoupled import uncoupled_least_squares
from jaxid.parameters import ParameterError
from reference.excitation import experiment, steps, wheels
from reference.logs import simulate_log
from reference.pioneer import PIONEER
from tests.pioneer_runs import SAMPLING, TRUTH, WRONG, as_log, uncoupled_runs


@pytest.fixture(scope="module")
def uncoupled_logs():
    return uncoupled_runs()


def equation_31(log, gain, moving):
    """NumPy alone: a11, a15, a18 of eq. 34 from all consecutive intervals in which the robot moves (eq. 31 as printed)."""
    v, h = log.output("eta1"), np.diff(log.time)
    force, sign = gain * (log.input("V2") + log.input("V3")), np.sign(v)
    F = np.stack([force[:-1] * h, -h * (v[1:] + v[:-1]) / 2, -h * (sign[1:] + sign[:-1]) / 2], axis=1)
    used = (np.abs(v) > moving)[1:] & (np.abs(v) > moving)[:-1]
    scale = np.linalg.norm(F[used], axis=0)
    return np.linalg.lstsq(F[used] / scale, np.diff(v)[used], rcond=None)[0] / scale


def straight(name):
    """A straight run of the Pioneer paper's demonstration logs."""
    return read_logs(demo.folder("pioneer_paper") / f"straight_{name}.csv", robot="pioneer")[0]


@pytest.mark.parametrize(("name", "mass"), [("1_prbs", 17.5), ("2_prbs", 17.0), ("3_step", 17.1)])
def test_two_samples_a_stretch_are_equation_31(name, mass):
    """On logs that another simulator wrote; the robot's masses from eq. 31 by hand are known from outside."""
    log = straight(name)
    p = Pioneer().parameters.numbers
    gain = p["tr"] * p["mu"] * p["KT"] / (p["R"] * p["Ra"])
    expected = equation_31(log, gain, moving=0.03)
    fit = uncoupled_least_squares(Pioneer(), [log], window=2)
    assert 1 / expected[0] == pytest.approx(mass, abs=0.1)
    assert fit["1/a11"].value == pytest.approx(1 / expected[0], abs=0.15 * fit["1/a11"].std_error)


@pytest.mark.slow
def test_equation_31_scatters_as_its_standard_errors_say():
    """Neighbouring integrals share samples: errors that count them as independent would be several times too large."""
    log = straight("2_prbs")
    clean = simulate_log(PIONEER, log.inputs, SAMPLING)[["eta1", "eta2"]].to_numpy()
    rng = np.random.default_rng(60)
    fits = []
    for _ in range(60):
        speeds = clean + rng.standard_normal(clean.shape) * [0.01, 0.02]
        noisy = Log.from_arrays("noisy", log.time, log.inputs, speeds, Pioneer())
        fits.append(uncoupled_least_squares(Pioneer(), [noisy], window=2))
    for name in ("1/a11", "Cv", "Cs"):
        values, errors = (np.array([getattr(fit[name], what) for fit in fits]) for what in ("value", "std_error"))
        assert 0.8 < np.sqrt(np.mean(errors**2)) / values.std(ddof=1) < 1.6
    assert np.std([fit["1/a11"].value for fit in fits]) < 0.12  # every other interval alone: 0.44


def test_both_equations_find_what_the_logs_were_simulated_with(uncoupled_logs):
    fit = uncoupled_least_squares(Pioneer().with_values(**WRONG), uncoupled_logs)
    assert fit["1/a11"].value == pytest.approx(17.078, rel=1e-3)
    assert fit["Cs"].value == pytest.approx(TRUTH["Cs"], rel=1e-4)
    assert fit["Cv"].value == pytest.approx(TRUTH["Cv"], rel=1e-4)
    # ym = 0 takes M ym^2 off 1/a22. Turning, the caster stands still in the body, so its friction is not seen.
    assert fit["1/a22"].value == pytest.approx(0.42418 - 15.5 * 0.07**2, rel=0.02)
    assert fit["Ir"].status == fit["I0"].status == fit["Ir1"].status == "not_identifiable"
    for name, (function, _, _) in Pioneer.combinations.items():  # the returned robot has the identified inertias
        assert function(fit.robot.parameters.numbers) == pytest.approx(fit[name].value, rel=1e-12)
    assert any("I0 to match 1/a22" in note for note in fit.notes)
    assert fit.method == "equations 34 and 35"


def test_on_the_coupled_robot_they_are_biased(uncoupled_logs):
    """With the centre of mass behind the axle (ym), turning on the spot drifts and equation 35 puts that into Cv1."""
    still = np.zeros(1000)
    drive = wheels(still, steps(1000, [0, 4, 6, 2.5]))
    spot = as_log("spot", simulate_log(PIONEER, drive, SAMPLING), Pioneer())
    fit = uncoupled_least_squares(Pioneer(), [uncoupled_logs["straight_prbs"], spot])
    assert fit["Cv1"].value > 50 * TRUTH["Cv1"]
    assert fit["1/a11"].value == pytest.approx(17.078, rel=1e-3)


def test_logs_and_robots_that_they_cannot_use(uncoupled_logs):
    arcs = as_log("arcs", simulate_log(PIONEER, experiment("pioneer", "arcs", 1000, 5), SAMPLING), Pioneer())
    with pytest.raises(LogError, match="none of arcs drives straight.*jaxid.integral_least_squares"):
        uncoupled_least_squares(Pioneer(), [arcs])
    with pytest.raises(LogError, match="no logs"):
        uncoupled_least_squares(Pioneer(), [])
    fixed = Pioneer().with_parameters(Pioneer().parameters.with_free())
    with pytest.raises(ParameterError, match="no parameter is free"):
        uncoupled_least_squares(fixed, uncoupled_logs[:1])
    with pytest.raises(ParameterError, match="know nothing of quadratic_drag"):
        uncoupled_least_squares(Pioneer() + QuadraticDrag(), uncoupled_logs[:1])


def test_one_kind_of_log_gives_what_it_can(uncoupled_logs):
    fit = uncoupled_least_squares(Pioneer(), uncoupled_logs[:2])
    assert fit["Cs"].status == "identified" and fit["1/a11"].status == "identified"
    assert fit["Cs1"].status == "not_identifiable" and fit["1/a22"].status == "not_identifiable"
    assert any("No log for equation 35" in note for note in fit.notes)
