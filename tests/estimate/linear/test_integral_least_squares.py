"""Integral least squares against analytic truths and an independent, event-accurate simulator."""

import sys
from pathlib import Path

import jax
import numpy as np
import pytest
from scipy.signal import butter, filtfilt
from scipy.stats import chi2

import jaxid
from jaxid import (
    Axis,
    Channels,
    Custom,
    DifferentialDrive,
    Log,
    LogError,
    LogSet,
    Omni,
    Parameter,
    ParameterError,
    Pioneer,
    float64,
)
from jaxid.estimate.linear.instrumental_variables import instrumental_variables
from jaxid.estimate.linear.integral_least_squares import integral_least_squares, linear_estimate
from jaxid.estimate.linear.log_rows import gather
from jaxid.estimate.linear.weighted_least_squares import solve_by_qr
from jaxid.estimate.linear.window_equations import _stretches
from reference.axis import AXIS
from reference.excitation import experiment
from reference.logs import simulate_log
from reference.omni import OMNI
from reference.pioneer import PIONEER
from tests.pioneer_runs import SAMPLING, TRUTH, WRONG, as_log, uncoupled_runs


def noisy(logs, sigma, seed):
    rng = np.random.default_rng(seed)
    return [
        Log.from_arrays(
            log.name, log.time, log.inputs, log.outputs + rng.standard_normal(log.outputs.shape) * sigma, log.channels
        )
        for log in logs
    ]


@pytest.fixture(scope="module")
def coupled_logs():
    kinds = ["prbs_forward", "prbs_reversing", "multilevel", "steps", "turning", "arcs"]
    inputs = [experiment("pioneer", kind, 1000, seed) for seed, kind in enumerate(kinds)]
    return LogSet(
        as_log(kind, simulate_log(PIONEER, u, SAMPLING), Pioneer()) for kind, u in zip(kinds, inputs, strict=True)
    )


@pytest.fixture(scope="module")
def uncoupled_logs():
    return uncoupled_runs()


AXIS_TRUTH = {"M": 20.0, "Fv": 30.0, "Fc": 6.0, "offset": 1.0}


@pytest.fixture(scope="module")
def axis_logs():
    """True sticking: reversals and crawling."""
    robot = AXIS.with_parameters(J=20.0, Cv=30.0, Cs=6.0, offset=-1.0, k=1.0)
    kinds = ["prbs_reversing", "multilevel", "crawl"]
    return LogSet(
        as_log(kind, simulate_log(robot, 20 * experiment("axis", kind, 1000, seed), SAMPLING), Axis())
        for seed, kind in enumerate(kinds)
    )


# -- the core ----------------------------------------------------------------------------------------------------------
def test_qr_solution_is_that_of_numpy():
    rng = np.random.default_rng(0)
    F = rng.standard_normal((50, 3)) * [1.0, 1e5, 1e-4]
    y = rng.standard_normal(50)
    theta, covariance, residuals = (np.asarray(x) for x in solve_by_qr(F, y))
    expected, squares, _, _ = np.linalg.lstsq(F / [1, 1e5, 1e-4], y, rcond=None)
    np.testing.assert_allclose(np.asarray(theta), expected / [1, 1e5, 1e-4], rtol=1e-11)
    np.testing.assert_allclose(float(residuals @ residuals), squares[0], rtol=1e-12)
    np.testing.assert_allclose(np.asarray(covariance), squares[0] / 47 * np.linalg.inv(F.T @ F), rtol=1e-7)


def test_qr_solution_in_lanes():
    rng = np.random.default_rng(1)
    F, y = rng.standard_normal((4, 20, 3)), rng.standard_normal((4, 20))
    with float64():
        thetas = jax.jit(jax.vmap(lambda a, b: solve_by_qr(a, b)[0]))(F, y)
    for k in range(4):
        np.testing.assert_allclose(np.asarray(thetas[k]), np.linalg.lstsq(F[k], y[k], rcond=None)[0], rtol=1e-10)


def linear_custom():
    return Custom(
        dynamics=lambda s, u, p: {"w": -p["a"] * s["w"] + p["b"] * u["u"] + p["c"]},
        state_names=("w",),
        own_channels=Channels(inputs=("u",), outputs=("w",)),
        table={name: Parameter(1.0, free=True) for name in "abc"},
    )


def test_linear_system_without_noise():
    """dw/dt = -a w + b u + c, exact at the samples: the midpoint rule on four substeps leaves (a h / 4)^2 / 24 of a."""
    rng = np.random.default_rng(2)
    a, b, c, h = 3.0, 2.0, -0.7, 0.01
    u = np.repeat(rng.uniform(-1, 1, 20), 25)
    w = np.zeros(500)
    decay = np.exp(-a * h)
    for k in range(499):
        w[k + 1] = decay * w[k] + (1 - decay) * (b * u[k] + c) / a
    fit = integral_least_squares(linear_custom(), [Log.from_arrays("w", h * np.arange(500), u, w, linear_custom())])
    for name, truth in (("a", a), ("b", b), ("c", c)):
        assert fit[name].value == pytest.approx(truth, rel=1.1 * (a * h / 4) ** 2 / 24)


def test_all_intervals_are_in_a_stretch():
    """Stretches meet at a sample, whatever their length; gaps break them."""
    whole = np.array([1, 1, 1, 1, 1, 0, 1, 1, 0, 1, 0], bool)  # the last sample of a log begins no interval
    log = np.array([0] * 9 + [1] * 2)
    for window in (2, 3, 4, 25):
        sample, stretch = _stretches(whole, log, window)
        pairs = [(a, b) for a, b, s, t in zip(sample, sample[1:], stretch, stretch[1:], strict=False) if s == t]
        assert pairs == [(0, 1), (1, 2), (2, 3), (3, 4), (4, 5), (6, 7), (7, 8), (9, 10)]
        assert np.bincount(stretch).max() <= window


@pytest.mark.parametrize("units", [(1e3, 1.0, 1.0), (1.0, 1e-3, 1.0), (1e-3, 1.0, 1.0), (1.0, 1e3, 1e-3)])
@pytest.mark.parametrize("start", ["scaled", "as it is"])
def test_units_do_not_matter(axis_logs, units, start):
    """The same logs with time, length and force in other units: the same axis, whether the table was adapted or not."""
    second, metre, newton = units  # new units in one old one
    logs = noisy(axis_logs, 0.01, seed=3)
    other = [
        Log.from_arrays(
            log.name, second * log.time, newton * log.inputs, log.outputs * np.array([metre / second, metre]), Axis()
        )
        for log in logs
    ]
    scale = {"M": newton * second**2 / metre, "Fv": newton * second / metre, "Fc": newton, "offset": newton}
    table = {name: Axis().parameters[name].value * scale[name] for name in scale} if start == "scaled" else {}
    one, two = integral_least_squares(Axis(), logs), integral_least_squares(Axis().with_values(**table), other)
    for name, factor in scale.items():
        assert two[name].value == pytest.approx(factor * one[name].value, abs=1e-4 * factor * one[name].std_error)
        assert two[name].std_error == pytest.approx(factor * one[name].std_error, rel=1e-4)
        assert two[name].status == one[name].status == "identified"
    assert two.converged == one.converged


# -- robots, without noise ---------------------------------------------------------------------------------------------
def test_axis_that_sticks(axis_logs):
    fit = integral_least_squares(Axis(), axis_logs)
    assert fit.converged and fit.method == "integral_least_squares"
    for name, truth in AXIS_TRUTH.items():
        assert fit[name].value == pytest.approx(truth, rel=1e-4)
        assert fit[name].status == "identified"
    assert fit["gain"].status == "fixed"
    assert fit.robot.parameters["M"].value == fit["M"].value


def test_axis_with_sensor_gaps(axis_logs):
    rng = np.random.default_rng(8)
    gappy = []
    for log in axis_logs:
        outputs = log.outputs.copy()
        outputs[rng.random(len(log)) < 0.05] = np.nan
        outputs[300:400] = np.nan
        gappy.append(Log.from_arrays(log.name, log.time, log.inputs, outputs, log.channels))
    fit = integral_least_squares(Axis(), gappy)
    for name, truth in AXIS_TRUTH.items():
        assert fit[name].value == pytest.approx(truth, rel=5e-3)


def test_the_balance_is_bridged_over_a_short_gap_and_broken_by_a_long_gap():
    time = 0.02 * np.arange(300)
    outputs = np.stack([np.sin(time), 1.0 - np.cos(time)], axis=1)
    outputs[50:53] = outputs[100:120] = np.nan
    rows = gather(Axis(), [Log.from_arrays("gappy", time, np.cos(time)[:, None], outputs, Axis())], ("v",))
    broken = np.zeros(300, bool)
    broken[99:120] = broken[-1] = True
    np.testing.assert_array_equal(rows.whole, ~broken)


@pytest.mark.slow
def test_omni_moving_in_all_directions():
    kinds = ["prbs_reversing", "multilevel", "turning"]
    logs = [
        as_log(kind, simulate_log(OMNI, experiment("omni", kind, 1000, seed), SAMPLING), Omni())
        for seed, kind in enumerate(kinds)
    ]
    wrong = Omni().with_values(J=2.0, Bv=1.0, Bvn=1.0, Bw=2.0, Cv=10.0, Cvn=10.0, Cw=1.0)
    fit = integral_least_squares(wrong, logs)
    for name in fit.free_names:
        assert fit[name].value == pytest.approx(OMNI.parameters[name], rel=1e-3)
    printed = integral_least_squares(wrong.uncoupled(), logs)  # eqs. 1-3 lack the turning frame's terms
    assert printed.robot.parameters["coriolis"].value == 0.0
    assert printed.noise["V"] > 10 * fit.noise["V"]


def test_values_of_the_table_that_are_right_are_no_worse_to_begin_with():
    """The yaw equation of a differential drive has no known force: at right values its terms cancel, and weighed by what is
    left it would be solved by no force and no inertia at all."""
    rng, dt, true = (
        np.random.default_rng(5),
        0.01,
        {"M": 12.0, "J": 0.25, "Fv": 11.0, "Fc": 3.0, "gain": 4.0, "b": 0.18},
    )
    robot, logs = DifferentialDrive(), []
    for k in range(2):
        u = np.repeat(rng.uniform(2.0, 6.0, (10, 2)), 50, axis=0)
        v, w, seen = 0.0, 0.0, []
        for right, left in true["gain"] * u:
            seen.append((v, w))
            for _ in range(10):
                rims = v + true["b"] * w, v - true["b"] * w
                forces = [
                    f - true["Fv"] * s - true["Fc"] * np.tanh(s / 1e-3)
                    for f, s in zip((right, left), rims, strict=True)
                ]
                v += 0.1 * dt * sum(forces) / true["M"]
                w += 0.1 * dt * true["b"] * (forces[0] - forces[1]) / true["J"]
        read = np.array(seen) + rng.normal(size=(500, 2)) * (0.01, 0.02)
        logs.append(Log.from_arrays(f"run {k}", dt * np.arange(500), u, read, robot))
    robot = robot.with_values(**true).change("M", free=False).change("gain", free=True)
    fits = [integral_least_squares(own, LogSet(logs)) for own in (robot, robot.with_values(Fc=5.0, Fv=20.0, J=0.5))]
    for name in ("J", "Fv", "Fc", "gain"):
        assert all(fit[name].status == "identified" for fit in fits), name
        np.testing.assert_allclose(fits[0][name].value, fits[1][name].value, rtol=1e-4)
        assert abs(fits[0][name].value - true[name]) < 0.05 * true[name]


def test_coupled_pioneer(coupled_logs):
    fit = integral_least_squares(Pioneer().with_values(**WRONG), coupled_logs)
    tolerance = {"Ip1": 0.01, "Cv1": 0.02, "Ir1": 4e-3, "Cs1": 4e-3}  # the caster turns within one sample
    for name in fit.free_names:
        assert fit[name].value == pytest.approx(TRUTH[name], rel=tolerance.get(name, 1e-3)), name
        assert fit[name].status == "identified"
    assert fit["1/a11"].value == pytest.approx(17.078, abs=2e-3)
    assert fit["1/a22"].value == pytest.approx(0.42418, abs=1e-4)


# -- what the data does not say ----------------------------------------------------------------------------------------
@pytest.mark.parametrize("sigma", [0.0, 1.0])
def test_straight_logs_say_nothing_about_turning(uncoupled_logs, sigma):
    logs = noisy(uncoupled_logs[:2], sigma * np.array([0.005, 0.01]), seed=1)
    fit = integral_least_squares(Pioneer(), logs)
    for name in ("I0", "Ip1", "Cs1", "Cv1"):
        assert fit[name].status == "not_identifiable"
        assert fit[name].value == TRUTH[name]
        assert np.isnan(fit[name].std_error)
    assert fit["1/a11"].status == "identified"
    assert fit["1/a22"].status == "not_identifiable"
    assert fit["1/a11"].value == pytest.approx(17.078, rel=5e-3)
    # Ir and Ir1 enter 1/a11 only: each is right only if the table's value of the other is.
    for name in ("Ir", "Ir1"):
        assert fit[name].status == "not_identifiable" and np.isnan(fit[name].std_error)
    rows = [fit.free_names.index("I0"), fit.free_names.index("Cs1")]
    assert np.isnan(fit.covariance[rows]).all()


def test_equations_that_did_not_settle_are_not_sound_however_little_they_leave(axis_logs, monkeypatch):
    settled = integral_least_squares(Axis(), axis_logs)
    identified = sys.modules[linear_estimate.__module__].identify
    monkeypatch.setattr(
        sys.modules[linear_estimate.__module__], "identify", lambda *given: (*identified(*given)[:3], False)
    )
    fit = integral_least_squares(Axis(), axis_logs)
    assert settled.judgement.trustworthy and settled.converged
    assert fit.judgement.verdict == "poor" and not fit.converged
    assert "did not settle" in fit.judgement.sentence and "at known values" in fit.judgement.sentence


def test_estimates_stay_within_bounds(axis_logs):
    fit = integral_least_squares(Axis().change("Fv", lower=35.0, value=40.0), axis_logs)
    assert fit["Fv"].status == "at_bound" and fit["Fv"].value == 35.0
    assert fit["M"].value > AXIS_TRUTH["M"]


def test_prior_weighs_in(axis_logs):
    fit = integral_least_squares(Axis().change("Fv", prior=(31.0, 1e-9)), noisy(axis_logs, 0.01, seed=2))
    assert fit["Fv"].value == pytest.approx(31.0, abs=1e-3)


# -- noise -------------------------------------------------------------------------------------------------------------
@pytest.mark.slow
def test_standard_errors_against_monte_carlo(axis_logs):
    """24 noisy repeats, whose scatter is known to a seventh: it is as the standard errors say, the bias small beside it."""
    names = list(AXIS_TRUTH)
    fits = [integral_least_squares(Axis(), noisy(axis_logs, 0.01, seed)) for seed in range(24)]
    values = np.array([[fit[name].value for name in names] for fit in fits])
    errors = np.array([[fit[name].std_error for name in names] for fit in fits])
    scatter = values.std(axis=0, ddof=1)
    np.testing.assert_allclose(np.sqrt(np.mean(errors**2, axis=0)), scatter, rtol=0.3)
    bias = values.mean(axis=0) - np.array(list(AXIS_TRUTH.values()))
    assert np.all(np.abs(bias) < 1.5 * scatter), bias / scatter
    noise = np.mean([fit.noise["v"] for fit in fits])
    assert noise == pytest.approx(0.01, rel=0.05)


def test_coupled_pioneer_in_noise(coupled_logs):
    fit = integral_least_squares(Pioneer().with_values(**WRONG), noisy(coupled_logs, [0.005, 0.01], seed=0))
    limits = {"Cs": 0.01, "Cv": 0.01, "I0": 0.01, "Ir": 0.2, "Ir1": 0.2, "Ip1": 0.4, "Cs1": 0.2}
    for name, limit in limits.items():
        assert fit[name].value == pytest.approx(TRUTH[name], rel=limit), name
    assert fit["1/a11"].value == pytest.approx(17.078, rel=3e-3)
    assert fit["1/a22"].value == pytest.approx(0.42418, rel=3e-3)
    assert fit.noise["eta1"] == pytest.approx(0.005, rel=0.1)
    # Where noise in the regressors was looked at, only what it does is said, and once.
    assert repr(fit).count("regressors") == bool(fit.judgement.biased)


# -- measured data -----------------------------------------------------------------------------------------------------
def emps():
    """EMPS (Janot, Gautier & Brunot 2019): position alone, closed loop; published by inverse dynamics least squares."""
    from scipy.io import loadmat

    path = Path(__file__).parents[3] / "../shared/data/emps/DATA_EMPS.mat"
    if not path.exists():
        pytest.skip("the measured EMPS log is not beside this checkout")
    data = loadmat(path)
    time, position, volts = (data[name].ravel() for name in ("t", "qm", "vir"))
    return Log.from_arrays("emps", time, float(data["gtau"].item()) * volts, {"q": position}, Axis())


def test_published_parameters_of_a_measured_axis():
    """The offset's standard error has a bound of its own: what disturbs this axis is slow (friction that depends on the
    position), so that its mean force cannot be known better than that of independent pieces of the record scatters,
    whatever the estimator. Five pieces by NumPy alone say how much; their scatter has four degrees of freedom."""
    log = emps()
    fit = integral_least_squares(Axis(), [log])
    for name, published in {"M": 95.1089, "Fv": 203.5034, "Fc": 20.3935, "offset": -3.1648}.items():
        assert abs(fit[name].value - published) < 2.5 * fit[name].std_error
        if name != "offset":
            assert fit[name].std_error < 0.07 * abs(published)
    smooth = butter(4, 100.0, fs=1e3)
    q, force = (filtfilt(*smooth, column) for column in (log.output("q"), log.input("u")))
    v = np.gradient(q, log.time)
    rows = np.stack([np.gradient(v, log.time), v, np.sign(v), np.ones_like(v)], axis=1)
    pieces = [
        np.linalg.lstsq(F, y, rcond=None)[0][3]
        for F, y in zip(np.array_split(rows, 5), np.array_split(force, 5), strict=True)
    ]
    scatter = np.std(pieces, ddof=1) / np.sqrt(5)
    low, high = np.sqrt(4 / chi2.ppf([0.95, 0.05], 4)) * scatter
    assert low < fit["offset"].std_error < high


# -- bad input ---------------------------------------------------------------------------------------------------------
def test_bad_input(axis_logs, coupled_logs):
    with pytest.raises(ParameterError, match="not linear in .*d.*fix"):
        integral_least_squares(Pioneer().change("d", free=True), coupled_logs[:1])
    with pytest.raises(ParameterError, match="not linear in KT, KE"):
        robot = Pioneer().with_parameters(Pioneer().parameters.with_free("KT", "KE"))
        integral_least_squares(robot, coupled_logs[:1])
    with pytest.raises(ParameterError, match="no parameter is free"):
        integral_least_squares(Axis().with_parameters(Axis().parameters.with_free()), axis_logs)
    with pytest.raises(ValueError, match="two or more"):
        integral_least_squares(Axis(), axis_logs, window=1)
    standing = Log.from_arrays("standing", 0.02 * np.arange(50), np.zeros(50), np.zeros(50), Axis())
    with pytest.raises(LogError, match="standing hold no two samples"):
        integral_least_squares(Axis(), [standing])
    hidden = Custom(
        dynamics=lambda s, u, p: {"w": p["a"] * u["u"]},
        state_names=("w",),
        own_channels=Channels(inputs=("u",), outputs=("y",)),
        table={"a": Parameter(1.0, free=True)},
        output=lambda s, u, p: {"y": 2 * s["w"]},
    )
    with pytest.raises(LogError, match="none of the outputs"):
        integral_least_squares(hidden, [Log.from_arrays("y", 0.02 * np.arange(50), np.ones(50), np.ones(50), hidden)])


def test_what_nobody_measured_cannot_hold_free_parameters():
    """A pendulum whose angle alone is logged: its angle's equation holds no parameter, and all were "not identifiable"."""
    channels = Channels(("u",), ("angle",), units={"u": "N m", "angle": "rad"})

    def dynamics(state, u, p):
        torque = u["u"] - p["weight"] * state["angle"] - p["damping"] * state["rate"]
        return {"angle": state["rate"], "rate": torque / p["inertia"]}

    table = {"inertia": 0.02, "weight": 0.3, "damping": 0.03}
    robot = Custom(
        dynamics=dynamics,
        state_names=("angle", "rate"),
        own_channels=channels,
        table={name: Parameter(value, free=True, lower=0.0) for name, value in table.items()},
        title="pendulum",
    )
    log = Log.from_arrays(
        "a", 0.02 * np.arange(200), np.sin(0.1 * np.arange(200)), np.cos(0.1 * np.arange(200)), channels
    )
    for estimator in (integral_least_squares, instrumental_variables):
        with pytest.raises(ParameterError, match="do not measure rate of 'pendulum', .* or use output error"):
            estimator(robot, [log])


def test_speeds_that_were_never_measured_at_one_time_are_said_to_be_so():
    time = 0.01 * np.arange(400)
    u = np.repeat(np.random.default_rng(0).uniform(-6.0, 6.0, (20, 2)), 20, axis=0)
    outputs = np.stack([np.sin(time), np.cos(time)], axis=1)
    outputs[np.arange(400) % 20 != 0, 0] = outputs[np.arange(400) % 20 != 10, 1] = np.nan
    log = Log.from_arrays("own clocks", time, u, outputs, "differential")
    with pytest.raises(LogError, match="no row of the logs own clocks holds all of v, w, .* Use output error"):
        integral_least_squares(jaxid.DifferentialDrive(), [log])


@pytest.mark.parametrize(
    ("method", "seed"), [(integral_least_squares, 2), (integral_least_squares, 3), (instrumental_variables, 0)]
)
def test_dry_friction_and_an_offset_are_not_told_apart_where_the_robot_moves_one_way_only(axis_log, method, seed):
    """It stands between, where noise goes either way, and the commands go both ways: that is no other direction."""
    random = np.random.default_rng(seed)
    true = {"M": 9.0, "Fv": 18.0, "Fc": 6.4, "offset": 0.8}
    commands = [np.repeat(random.uniform(-8.8, 7.1, 15), 50) for _ in range(2)]

    def logs(times):
        own = {"noise": 0.006, "position": False, **true}
        return LogSet([axis_log(f"{k}", times * u, seed=10 * seed + k, **own) for k, u in enumerate(commands)])

    start = Axis().with_values(M=5.0, Fv=10.0, Fc=5.0)
    fit = method(start, logs(1.0))
    assert [fit[name].status for name in ("Fc", "offset")] == ["not_identifiable"] * 2
    assert any("push alike all the time" in note for note in fit.notes)
    told = method(start, logs(2.0))
    for name in ("Fc", "offset"):
        assert told[name].status == "identified" and abs(told[name].value - true[name]) < 0.1 * true["Fc"]
