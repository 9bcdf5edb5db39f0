"""Instrumental variables: unbiased where noise is in the regressors, with intervals that hold the truth; against a drive
axis in closed form and the independent simulator."""

import numpy as np
import pytest

from jaxid import (
    Axis,
    Channels,
    Custom,
    Log,
    LogError,
    LogSet,
    Omni,
    Parameter,
    ParameterError,
    Pioneer,
    instrumental_variables,
    output_error,
)
from jaxid.estimate.linear.integral_least_squares import integral_least_squares
from reference.excitation import experiment
from reference.logs import simulate_log
from reference.omni import OMNI
from reference.pioneer import PIONEER

TRUTH = {"M": 1.0, "Fv": 2.0, "Fc": 0.5, "offset": 0.1}
SAMPLES = 500


def levels(seed):
    return experiment("axis", "multilevel", SAMPLES, seed)[:, 0]


@pytest.fixture(scope="module")
def clean(axis_log):
    return axis_log("clean", levels(3), **TRUTH)


def measured(log, sigma, seed, colour=0.0):
    rng = np.random.default_rng(seed)
    noise = rng.normal(size=log.outputs.shape)
    for k in range(1, len(noise)):
        noise[k] = colour * noise[k - 1] + np.sqrt(1 - colour**2) * noise[k]
    return Log.from_arrays(log.name, log.time, log.inputs, log.outputs + sigma * noise, log.channels)


def repeated(estimator, log, sigma, colour=0.0):
    fits = [estimator(Axis(), [measured(log, sigma, seed, colour)]) for seed in range(40)]
    off = np.array([[fit[name].value - truth for name, truth in TRUTH.items()] for fit in fits])
    errors = np.array([[fit[name].std_error for name in TRUTH] for fit in fits])
    return fits, off, errors


def test_without_noise_it_is_the_truth(clean):
    fit = instrumental_variables(Axis(), [clean])
    assert fit.converged and fit.method == "instrumental_variables"
    for name, truth in TRUTH.items():
        assert fit[name].value == pytest.approx(truth, rel=2e-3)
        assert fit[name].status == "identified"
    assert fit["gain"].status == "fixed"
    assert fit.robot.parameters["M"].value == fit["M"].value


def test_time_stamps_may_be_irregular_and_the_first_interval_an_odd_one(axis_log):
    """Samples 6 to 34 ms apart, the first 160 ms: estimates over ten draws of noise, against the axis in closed form."""
    intervals = 0.02 * np.random.default_rng(7).uniform(0.3, 1.7, SAMPLES)
    intervals[0] = 0.16
    clean = axis_log("irregular", levels(3), dt=intervals, **TRUTH)
    fits = [instrumental_variables(Axis(), [measured(clean, 0.02, seed)]) for seed in range(10)]
    for name, truth in TRUTH.items():
        off = [(fit[name].value - truth) / fit[name].std_error for fit in fits]
        assert all(fit.converged for fit in fits) and abs(np.mean(off)) < 3.5 / np.sqrt(10) and np.max(np.abs(off)) < 4


@pytest.mark.slow
@pytest.mark.parametrize("colour", [0.8, pytest.param(0.0, marks=pytest.mark.slow)])
def test_unbiased_and_covered_where_the_regressors_are_noisy(clean, colour):
    fits, off, errors = repeated(instrumental_variables, clean, 0.05, colour)
    assert np.mean([fit.converged for fit in fits]) == 1.0
    scatter = off.std(axis=0, ddof=1)
    assert np.all(np.abs(off.mean(axis=0)) < 3.5 * scatter / np.sqrt(len(fits)))  # 3.5 standard errors of a mean
    assert 0.88 <= np.mean(np.abs(off) <= 1.96 * errors) <= 0.99
    assert max(fit.iterations for fit in fits) <= 8


FIRST_ORDER = Custom(
    dynamics=lambda s, u, p: {"w": -p["a"] * s["w"] + p["b"] * u["u"]},
    state_names=("w",),
    own_channels=Channels(inputs=("u",), outputs=("w",)),
    table={name: Parameter(1.0, free=True) for name in "ab"},
)


def first_order(a, b, h, sigma, seed):
    """A log of dw/dt = -a w + b u, exact at the samples, with white noise on w."""
    u = np.repeat(np.random.default_rng(11).uniform(-1, 1, SAMPLES // 10), 10)
    w, decay = np.zeros(SAMPLES), np.exp(-a * h)
    for k in range(SAMPLES - 1):
        w[k + 1] = decay * w[k] + (1 - decay) * b / a * u[k]
    noisy = w + sigma * np.random.default_rng(seed).normal(size=SAMPLES)
    return Log.from_arrays("first order", h * np.arange(SAMPLES), u, noisy, FIRST_ORDER)


@pytest.mark.slow
def test_least_squares_is_what_it_mends():
    """A fast system, whose measured output is itself the regressor: least squares is off by a standard
    deviation of one fit, which no longer record mends, instrumental variables by none."""
    truth = np.array([16.0, 48.0])
    fits = {"iv": [], "ls": []}
    for seed in range(30):
        log = first_order(*truth, 0.02, 0.3, seed)
        linear = integral_least_squares(FIRST_ORDER, [log])
        fits["ls"].append(linear)
        fits["iv"].append(instrumental_variables(FIRST_ORDER, [log], linear))
    off = {key: np.array([[fit[n].value for n in "ab"] for fit in own]) - truth for key, own in fits.items()}
    errors = np.array([[fit[n].std_error for n in "ab"] for fit in fits["iv"]])
    bias = {key: values.mean(axis=0) / values.std(axis=0, ddof=1) for key, values in off.items()}
    assert np.all(np.abs(bias["ls"]) > 3.5 / np.sqrt(30))
    assert np.all(np.abs(bias["iv"]) < 3.5 / np.sqrt(30))
    # It says so itself, by how much, and what to take instead.
    said = [fit.judgement for fit in fits["ls"]]
    assert np.mean([set(judgement.biased) == {"a", "b"} for judgement in said]) >= 0.9
    assert all("instrumental variables" in j.better and not j.trustworthy for j in said if j.biased)
    predicted = np.array([[fit.judgement.biased.get(n, 0.0) * fit[n].std_error for n in "ab"] for fit in fits["ls"]])
    missed = np.abs(predicted.mean(axis=0) - off["ls"].mean(axis=0))
    assert np.all(missed < 3.5 * off["ls"].std(axis=0) / np.sqrt(30))
    assert fits["ls"][0].status_of("a") == "identified, biased by noise" and repr(fits["ls"][0]).startswith("Biased: ")
    assert all(not fit.judgement.biased for fit in fits["iv"])
    assert 0.85 <= np.mean(np.abs(off["iv"]) <= 1.96 * errors)


@pytest.mark.slow
@pytest.mark.parametrize(
    "estimator", [pytest.param(integral_least_squares, marks=pytest.mark.slow), instrumental_variables]
)
def test_an_interval_knows_what_its_neighbour_leaves_open(axis_log, estimator):
    """Viscous friction that the logs hardly show beside dry friction, and a table that has it ten times too large: the
    interval of dry friction holds the truth, and would not with the other held at the table's value."""
    rng = np.random.default_rng(1)
    u = np.repeat(2.0 * (-1.0) ** np.arange(20) * rng.uniform(0.8, 1.2, 20), 25)
    clean = axis_log("reversing", u, M=1.0, Fv=0.05, Fc=0.5, offset=0.0)
    table = Axis().change("offset", value=0.0, free=False).with_values(M=1.0, Fv=0.5, Fc=0.4)
    held = Axis().change("offset", value=0.0, free=False).change("Fv", value=0.5, free=False)
    within, with_it_held = [], []
    for seed in range(15):
        log = measured(clean, 0.05, seed)
        fit, other = (estimator(robot, [log])["Fc"] for robot in (table, held))
        within.append(fit.status == "identified" and abs(fit.value - 0.5) <= 1.96 * fit.std_error)
        with_it_held.append(abs(other.value - 0.5) <= 1.96 * other.std_error)
    assert np.mean(within) >= 0.85 > 0.6 > np.mean(with_it_held)


@pytest.mark.slow
def test_omni_against_the_independent_simulator():
    rng = np.random.default_rng(4)
    logs = []
    for seed, kind in enumerate(("multilevel", "turning")):
        frame = simulate_log(OMNI, experiment("omni", kind, SAMPLES, seed), 0.02)
        outputs = frame[["V", "Vn", "W"]].to_numpy() + rng.normal(size=(len(frame), 3)) * [0.02, 0.02, 0.04]
        logs.append(Log.from_arrays(kind, frame["t"], frame[list(Omni().channels.inputs)].to_numpy(), outputs, Omni()))
    wrong = Omni().with_values(J=2.0, Bv=1.0, Bvn=1.0, Bw=2.0, Cv=10.0, Cvn=10.0, Cw=1.0)
    fit = instrumental_variables(wrong, logs)
    assert fit.converged
    bound = output_error(Omni(), LogSet(logs), covariance="white")
    for name in fit.free_names:
        assert abs(fit[name].value - OMNI.parameters[name]) < 3.5 * fit[name].std_error, name
        # No estimator knows Bvn better than to 23 % here (the Cramér-Rao bound, which output error reaches); instrumental
        # variables begin anew after every interval in which something stood still, and so may know half as much less.
        assert fit[name].std_error < 1.5 * bound[name].std_error
    assert fit.noise["V"] == pytest.approx(0.02, rel=0.15) and fit.noise["W"] == pytest.approx(0.04, rel=0.15)


def test_pioneer_against_the_independent_simulator():
    """Its caster turns within one sample, which no interpolation between samples follows: what that gets wrong must not
    remain. Without noise the estimates are off by less than a tenth of what the usual noise leaves open."""
    clean, noisy = [], []
    rng = np.random.default_rng(2)
    for seed, kind in enumerate(("multilevel", "turning")):
        frame = simulate_log(PIONEER, experiment("pioneer", kind, SAMPLES, seed + 40), 0.02)
        outputs = frame[["eta1", "eta2"]].to_numpy()
        for logs, noise in ((clean, 0.0), (noisy, rng.normal(size=outputs.shape) * [0.01, 0.02])):
            inputs = frame[list(Pioneer().channels.inputs)].to_numpy()
            logs.append(Log.from_arrays(kind, frame["t"], inputs, outputs + noise, Pioneer()))
    robot = Pioneer().change("Cv1", free=False)
    right, fit = (instrumental_variables(robot, logs) for logs in (clean, noisy))
    assert right.converged and fit.converged and fit.iterations <= 6
    for name in fit.free_names:
        truth = PIONEER.parameters[name]
        assert abs(right[name].value - truth) < 0.1 * fit[name].std_error, name
        assert abs(fit[name].value - truth) < 3.5 * fit[name].std_error, name


@pytest.mark.parametrize("units", [(1e3, 1.0, 1.0), (1.0, 1e3, 1e-3)])
def test_units_do_not_matter(clean, units):
    second, metre, newton = units
    one = measured(clean, 0.05, 1)
    speed_and_position = np.array([metre / second, metre])
    two = Log.from_arrays("two", second * one.time, newton * one.inputs, one.outputs * speed_and_position, one.channels)
    scale = {"M": newton * second**2 / metre, "Fv": newton * second / metre, "Fc": newton, "offset": newton}
    here, there = (instrumental_variables(Axis(), [log]) for log in (one, two))
    for name, factor in scale.items():
        assert there[name].value == pytest.approx(factor * here[name].value, abs=2e-2 * factor * here[name].std_error)
        assert there[name].std_error == pytest.approx(factor * here[name].std_error, rel=1e-2)
        assert there[name].status == here[name].status
    assert there.converged == here.converged


@pytest.mark.parametrize("seed", [8, 9, 5])
def test_weak_instruments_are_recognised(axis_log, clean, seed):
    """Inputs of another run: what is simulated has nothing to do with what was measured."""
    other = axis_log("other", levels(seed), **TRUTH)
    mixed = Log.from_arrays("mixed", clean.time, other.inputs, measured(clean, 0.05, 0).outputs, clean.channels)
    fit = instrumental_variables(Axis(), [mixed])
    assert not fit.converged
    assert "weak" in fit.reason or "diverges" in fit.reason
    if "weak" in fit.reason:
        assert any("not to be trusted" in note for note in fit.notes)
    else:
        assert all(fit[name].status == "not_identifiable" for name in TRUTH)


def test_a_simulation_that_diverges_is_said():
    """dw/dt = a w + b u with a > 0 runs away from any error of its start."""
    robot = Custom(
        dynamics=lambda s, u, p: {"w": p["a"] * s["w"] + p["b"] * u["u"]},
        state_names=("w",),
        own_channels=Channels(inputs=("u",), outputs=("w",)),
        table={name: Parameter(1.0, free=True) for name in "ab"},
    )
    rng, w, h = np.random.default_rng(0), np.zeros(SAMPLES), 0.02
    u = np.zeros(SAMPLES)
    grow = np.exp(3.0 * h)
    for k in range(SAMPLES - 1):  # a controller holds it about zero
        u[k] = -5.0 * w[k] + 20.0 * rng.normal()
        w[k + 1] = grow * w[k] + (grow - 1) / 3.0 * u[k]
    log = Log.from_arrays("held", h * np.arange(SAMPLES), u, w + 0.05 * rng.normal(size=SAMPLES), robot)
    fit = instrumental_variables(robot, [log])
    assert not fit.converged
    assert "diverges" in fit.reason or "weak" in fit.reason or "settle" in fit.reason


def test_an_estimate_without_instruments_is_failed_and_not_sound(clean, monkeypatch):
    monkeypatch.setattr("jaxid.estimate.linear.instrumental_variables.followed_simulation", lambda robot, logs: None)
    fit = instrumental_variables(Axis(), [clean])
    assert fit.failed and "diverges" in fit.notes[0] and "diverges" in fit.reason
    assert all(fit[name].status == "not_identifiable" for name in TRUTH)


def test_bad_input(clean):
    with pytest.raises(ParameterError, match="no parameter is free"):
        instrumental_variables(Axis().with_parameters(Axis().parameters.with_free()), [clean])
    with pytest.raises(ParameterError, match="not linear"):
        instrumental_variables(Axis().change("gain", free=True).change("back_emf", free=True), [clean])
    still = Log.from_arrays("still", clean.time, clean.inputs, np.zeros((SAMPLES, 2)), clean.channels)
    with pytest.raises(LogError):
        instrumental_variables(Axis(), [still])


COUPLED = Custom(
    dynamics=lambda s, u, p: {
        "v": -p["a"] * s["v"] + p["c"] * s["w"] + p["b"] * u["u"],
        "w": -p["a"] * s["w"] - p["c"] * s["v"],
    },
    state_names=("v", "w"),
    own_channels=Channels(inputs=("u",), outputs=("v", "w")),
    table={name: Parameter(1.0, free=True) for name in "abc"},
)


@pytest.mark.slow
def test_noise_of_one_speed_in_the_equation_of_another_is_counted():
    """Two speeds that turn into each other (gyroscopic coupling), exact at the samples: the noise of each is a slow error of
    the other's equation. Counted as noise of its own equation alone, `a` and `b` would scatter 1.75 times what is reported."""
    a, b, c, h = 1.0, 2.0, 4.0, 0.02
    turn = (-a + 1j * c) * h  # v - iw turns with it
    u = np.repeat(np.random.default_rng(12).uniform(-1, 1, SAMPLES // 20), 20)
    z = np.zeros(SAMPLES, complex)
    for k in range(SAMPLES - 1):
        z[k + 1] = np.exp(turn) * z[k] + (np.exp(turn) - 1) / turn * h * b * u[k]
    motion = np.stack([z.real, -z.imag], axis=1)
    found, errors = [], []
    for seed in range(40):
        y = motion + 0.05 * np.random.default_rng(seed).normal(size=motion.shape)
        fit = instrumental_variables(COUPLED, [Log.from_arrays("coupled", h * np.arange(SAMPLES), u, y, COUPLED)])
        found.append([fit[n].value for n in "abc"])
        errors.append([fit[n].std_error for n in "abc"])
    off, errors = np.array(found) - [a, b, c], np.array(errors)
    ratio = off.std(axis=0, ddof=1) / np.median(errors, axis=0)
    assert np.all(np.abs(ratio[:2] - 1.0) < 0.35) and ratio[2] < 1.35  # three standard deviations of a scatter
    assert np.all(np.mean(np.abs(off) <= 1.96 * errors, axis=0) >= 0.85)
