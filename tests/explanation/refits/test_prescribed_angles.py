"""Wheel angles prescribed to a model with a torque ripple: logs of the independent simulator, whose true angle is known."""

import numpy as np
import pytest

pytest.importorskip("numba")
from benchmarks.hidden.cases import make  # noqa: E402
from jaxid import Axis, Log, LogSet, explain, output_error, read_logs
from jaxid.effects import effect_by_id
from jaxid.estimate.noise_colour import Colour
from jaxid.explanation.left.heldout import held_out_state
from jaxid.explanation.refits.prescribed_angles import PRESCRIBED, fit_with_prescribed_angles, predicted
from jaxid.explanation.refits.refit import Prediction, Trial
from jaxid.explanation.refits.smoothed_angles import smoothed_angles
from jaxid.explanation.search.in_colour import in_colour
from jaxid.model_file import read_model
from jaxid.simulation.integrated_angles import integrated_angles
from reference import excitation  # noqa: E402
from reference.axis import AXIS  # noqa: E402
from reference.logs import simulate  # noqa: E402

AMPLITUDE, PERIODS, NOISE = 12.0, 8.0, {"v": 0.01}
BARE = Axis().with_values(M=20.0, Fv=30.0, Fc=8.0, gain=10.0)
RIPPLED = (BARE + effect_by_id(BARE, "cogging_torque")).with_values(
    **{"cogging_torque.sine_q": AMPLITUDE, "cogging_torque.periods": 2 * np.pi * PERIODS}
)


def driven(amplitude: float):
    """Logs of two experiments and the true angles [m] in them."""
    robot = AXIS.with_parameters(J=20.0, k=10.0, Cv=30.0, Cs=8.0)
    hidden = {"cogging_torque": {"amplitude": amplitude, "periods": PERIODS}}
    logs, angles = [], []
    for number, kind in enumerate(("prbs_reversing", "crawl")):
        inputs = excitation.experiment("axis", kind, 1001, 70 + number)
        run = simulate(robot, inputs, 0.02, hidden, rtol=1e-7, atol=1e-9)
        v = run.speeds + 0.01 * np.random.default_rng(number).standard_normal(run.speeds.shape)
        logs.append(Log.from_arrays(kind, run.t, inputs, v, BARE.channels))
        angles.append(run.states[:, 0])
    return LogSet(logs), angles


@pytest.fixture(scope="module")
def runs():
    """A ripple stronger than the friction: it decides where the axis comes to rest."""
    return driven(AMPLITUDE)


def error(found, angles) -> float:
    return float(
        np.sqrt(np.mean([np.mean((np.asarray(found["q"])[e, : len(q)] - q) ** 2) for e, q in enumerate(angles)]))
    )


def test_the_model_knows_the_angle_better_than_the_sum_of_the_speeds(runs):
    logs, angles = runs
    summed, smoothed = (
        error(integrated_angles(RIPPLED, logs), angles),
        error(smoothed_angles(RIPPLED, logs, NOISE, {}), angles),
    )
    assert smoothed < 0.5 * summed
    assert smoothed < 0.05 / PERIODS  # of a period


def test_a_free_simulation_that_loses_its_way_gets_prescribed_angles(runs):
    """Half a percent of the ripple's period is enough to end in other notches; with prescribed angles the model is right."""
    logs, _ = runs
    off = RIPPLED.with_values(**{"cogging_torque.periods": 2 * np.pi * PERIODS * 1.005})
    free, state = held_out_state(off, logs, NOISE), predicted(off, logs, NOISE)
    assert free.normalised_rms > 3 and free.simulated_freely is None
    assert state.normalised_rms < 1.5 and state.simulated_freely.normalised_rms == free.normalised_rms


def test_what_needs_no_angles_is_simulated_freely(runs):
    assert predicted(BARE, runs[0], NOISE).simulated_freely is None


def test_whitened_it_is_predicted_with_prescribed_angles_too(runs):
    """A free simulation had been held against coloured noise: a ripple that left only that was no known effect."""
    logs, _ = runs
    off = RIPPLED.with_values(**{"cogging_torque.periods": 2 * np.pi * PERIODS * 1.005})
    angles = smoothed_angles(off, logs, NOISE, {})
    fitted = held_out_state(off, logs, NOISE, angles)
    trial = Trial("cogging_torque", off, fitted.squares, 6, fitted, Prediction(off, logs, NOISE), {}, angles)
    again = in_colour(trial, {"v": Colour.first_order(1.0, 0.3)}, logs, logs, NOISE)
    assert again.robot is not off and again.held_out.normalised_rms < 1.5


@pytest.fixture(scope="module")
def prescribed_fit(runs):
    """Fitted from a start that is 10 to 20 % off, on two logs."""
    off = {"M": 1.1, "Fv": 0.9, "cogging_torque.sine_q": 0.8, "cogging_torque.periods": 1.001}
    start = {name: off.get(name, 1.0) * RIPPLED.parameters[name].value for name in RIPPLED.parameters.free_names}
    return fit_with_prescribed_angles(RIPPLED, runs[0], NOISE, start, {})


@pytest.mark.slow
def test_a_fit_with_prescribed_angles_finds_the_ripple(prescribed_fit):
    amplitude = np.hypot(prescribed_fit["cogging_torque.sine_q"].value, prescribed_fit["cogging_torque.cosine_q"].value)
    assert prescribed_fit["M"].value == pytest.approx(20.0, rel=0.02)
    assert prescribed_fit["Fv"].value == pytest.approx(30.0, rel=0.1 / 3)
    assert amplitude == pytest.approx(AMPLITUDE, rel=0.05)
    assert prescribed_fit.noise["v"] == pytest.approx(NOISE["v"], rel=0.15)


@pytest.mark.parametrize(
    ("name", "true", "within"),
    [("cogging_torque.sine_q", AMPLITUDE, 0.05), ("cogging_torque.periods", 2 * np.pi * PERIODS, 1e-3)],
)
def test_a_fit_with_prescribed_angles_finds_the_ripples_phase_and_period(prescribed_fit, name, true, within):
    assert prescribed_fit[name].value == pytest.approx(true, rel=within)


def test_a_ripple_that_can_be_followed_freely_is_so_where_the_angle_is_measured_too():
    """With the angle prescribed, a log's position no longer counts; the free simulation, in which it does, must not lose"""
    logs, angles = driven(3.0)
    rng = np.random.default_rng(9)
    measured = []
    for log, q in zip(logs, angles, strict=True):
        outputs = {"v": log.output("v"), "q": q + 2e-3 * rng.standard_normal(q.size)}
        measured.append(Log.from_arrays(log.name, log.time, log.inputs, outputs, BARE.channels))
    start = {name: RIPPLED.parameters[name].value for name in RIPPLED.parameters.free_names}
    fit = fit_with_prescribed_angles(
        RIPPLED, LogSet(measured), NOISE | {"q": 2e-3}, start | {"cogging_torque.sine_q": 3.3}, {}
    )
    assert PRESCRIBED not in fit.notes
    assert fit.noise["q"] == pytest.approx(2e-3, rel=0.15)
    assert fit["cogging_torque.sine_q"].value == pytest.approx(3.0, rel=0.02)


@pytest.mark.slow  # half a minute; test_naming names a ripple in the default run
def test_a_strong_ripple_is_named_whether_or_not_it_can_be_followed_freely(tmp_path):
    case = make("axis", {"cogging_torque": 30.5}, 367)
    fitted, held, nominal = case.write(tmp_path)
    robot = read_model(nominal, Axis())
    logs, held_out = (read_logs([str(path) for path in paths], robot="axis") for paths in (fitted, held))
    found = explain(output_error(robot, logs), logs, held_out)
    assert found.verdict == "named" and [effect.id for effect in found.effects] == ["cogging_torque"]
    assert found.after.normalised_rms < 1.3
    assert (found.after.simulated_freely is not None) == ("prescribed from measurements" in found.sentence)
    freely = (found.after.simulated_freely or found.after).normalised_rms
    gap = found.to_dict()["gap"]
    assert gap["after_simulated_freely"] == freely >= gap["after"]
    periods = found.effects[0].parameters["periods"].value / (2 * np.pi)
    assert periods == pytest.approx(case.effects["cogging_torque"]["periods"], rel=0.01)


@pytest.mark.slow  # two of these are a quarter of a minute
@pytest.mark.parametrize("seed", [1, 2])
def test_a_period_a_cycle_off_on_a_long_way_is_found_and_its_interval_allows_for_the_angles(seed):
    """A motor of a bench with currents, which drives on for 250 rad in one log and rests in notches in others: angles that are
    smoothed through a model of a cycle less bend to it."""
    bare = Axis().with_values(M=3.2e-4, Fv=1.5e-5, Fc=0.0075, gain=0.0302)
    true = {"cogging_torque.sine_q": 0.0045, "cogging_torque.cosine_q": 0.0, "cogging_torque.periods": 7.0}
    robot = (bare + effect_by_id(bare, "cogging_torque")).with_values(**true)
    rng, logs, n = np.random.default_rng(seed), [], 2000
    for number in range(4):
        if number < 3:
            inputs = np.repeat(rng.uniform(0.2, 0.5, n // 100) * rng.choice([-1.0, 1.0], n // 100), 100)[:, None]
        else:
            inputs = np.where(np.arange(n) < 1200, 0.32, 0.24)[:, None]
            inputs = inputs + 0.02 * np.repeat(rng.normal(size=n // 50), 50)[:, None]
        hidden = {"cogging_torque": {"amplitude": 0.0045, "periods": 7.0 / (2.0 * np.pi)}}
        plant = AXIS.with_parameters(J=3.2e-4, k=0.0302, Cv=1.5e-5, Cs=0.0075)
        run = simulate(plant, inputs, 0.005, hidden, rtol=1e-7, atol=1e-9)
        v = run.speeds + 0.4 * rng.standard_normal(run.speeds.shape)
        logs.append(Log.from_arrays(f"{number}", run.t, inputs, v, bare.channels))
    way = float(np.ptp(np.cumsum(logs[3].output("v")) * 0.005))
    start = {name: robot.parameters[name].value for name in robot.parameters.free_names}
    start["cogging_torque.periods"] -= 2.0 * np.pi / way
    fit = fit_with_prescribed_angles(robot, LogSet(logs), {"v": 0.4}, start, {})
    assert PRESCRIBED in fit.notes
    for name in start:
        assert abs(fit[name].value - robot.parameters[name].value) < 4.0 * fit[name].std_error, name
