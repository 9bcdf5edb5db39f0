"""jaxid/estimate/robust_loss.py: gross outliers cost little and are listed; weights and slopes against their losses."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxid import Axis, Log, LogSet, output_error
from jaxid.estimate.output_error.losses import loss_named

TRUE = {"M": 1.0, "Fv": 2.0, "Fc": 0.5}
ROBOT = Axis().change("offset", free=False).with_values(**TRUE)
INPUTS = np.repeat([3.0, -2.0, 4.0, 0.8, -4.0, 1.5], 100)
LOSSES = {
    "huber": lambda u: jnp.where(jnp.abs(u) < 1.345, u**2 / 2, 1.345 * jnp.abs(u) - 1.345**2 / 2),
    "cauchy": lambda u: 2.385**2 / 2 * jnp.log1p((u / 2.385) ** 2),
    "student_t": lambda u: 5 / 2 * jnp.log1p(u**2 / 4),
}


@pytest.mark.usefixtures("double_precision")
@pytest.mark.parametrize("loss", LOSSES)
def test_weights_and_slopes_are_those_of_the_loss(loss):
    u = np.array([-30.0, -2.5, -1.0, -1e-3, 0.2, 1.2, 1.5, 7.0])
    psi = jax.vmap(jax.grad(LOSSES[loss]))(jnp.asarray(u))
    assert loss_named(loss).weight(u) * u == pytest.approx(np.asarray(psi), rel=1e-9)
    slope = jax.vmap(jax.grad(jax.grad(LOSSES[loss])))(jnp.asarray(u))
    assert loss_named(loss).slope(u) == pytest.approx(np.asarray(slope), rel=1e-9)


def runs(axis_log, seed, share=0.05):
    """Two clean runs and the same with gross outliers in a share of the samples, and where those are."""
    rng = np.random.default_rng(seed)
    clean, dirty, hits = [], [], {}
    for k in range(2):
        log = axis_log(f"run {k}", np.roll(INPUTS, 100 * k), noise=0.01, seed=7 * seed + k, position=False, **TRUE)
        v = np.array(log.output("v"))
        hit = rng.random(v.shape) < share
        v[hit] += rng.choice([-1, 1], hit.sum()) * rng.uniform(0.1, 2.0, hit.sum())
        clean.append(log)
        dirty.append(Log.from_arrays(log.name, log.time, log.inputs, {"v": v}, log.channels))
        hits[log.name] = set(np.round(log.time[hit], 6))
    return LogSet(clean), LogSet(dirty), hits


@pytest.fixture(scope="module")
def without_and_with_outliers(axis_log):
    """The fit of the clean runs and the runs with outliers, twelve times."""
    pairs = [runs(axis_log, seed)[:2] for seed in range(12)]
    return [(output_error(ROBOT, clean), dirty) for clean, dirty in pairs]


@pytest.mark.parametrize(
    "loss", ["student_t", *(pytest.param(other, marks=pytest.mark.slow) for other in ("huber", "cauchy"))]
)
def test_five_percent_of_gross_outliers_cost_less_than_thirty_percent(without_and_with_outliers, loss):
    clean_errors, robust_errors, inside = [], [], []
    for reference, dirty in without_and_with_outliers:
        fit = output_error(ROBOT, dirty, loss=loss)
        assert fit.noise["v"] == pytest.approx(0.01, rel=0.15)
        clean_errors.append([(reference[n].value - v) / reference[n].std_error for n, v in TRUE.items()])
        robust_errors.append([(fit[n].value - v) / reference[n].std_error for n, v in TRUE.items()])
        inside.append([abs(fit[n].value - v) < 1.96 * fit[n].std_error for n, v in TRUE.items()])
    assert np.sqrt(np.mean(np.square(robust_errors)) / np.mean(np.square(clean_errors))) < 1.3
    assert np.mean(inside) > 0.85


def test_squares_would_have_been_far_off_and_the_samples_are_listed(axis_log):
    _, dirty, hits = runs(axis_log, 3)
    squares, fit = output_error(ROBOT, dirty), output_error(ROBOT, dirty, loss="cauchy")
    assert squares.outliers == () and squares["M"].std_error > 5 * fit["M"].std_error
    listed = {name: set() for name in hits}
    for outlier in fit.outliers:
        times = dirty[outlier.log].time
        within = times[(times >= outlier.start) & (times <= outlier.stop)]
        listed[outlier.log] |= set(np.round(within, 6))
        assert outlier.channel == "v" and abs(outlier.deviations) > 4.5 and outlier.samples <= len(within)
    for name, true in hits.items():
        assert len(true & listed[name]) > 0.95 * len(true)  # those of 0.1 m/s are ten standard deviations off
        assert len(listed[name] - true) < 0.01 * len(dirty[name])


def test_without_outliers_the_robust_fit_is_the_plain_one_with_slightly_wider_intervals(axis_log):
    clean, _, _ = runs(axis_log, 5)
    plain = output_error(ROBOT, clean)
    for loss in LOSSES:
        fit = output_error(ROBOT, clean, loss=loss)
        for name in TRUE:
            assert abs(fit[name].value - plain[name].value) < plain[name].std_error
            assert 0.95 < fit[name].std_error / plain[name].std_error < 1.15
        assert sum(o.samples for o in fit.outliers) <= 1


def test_a_whole_log_of_garbage_is_named_and_a_robust_loss_lets_the_rest_stand(axis_log):
    clean, _, _ = runs(axis_log, 1)
    extra = axis_log("run 2", np.roll(INPUTS, 200), noise=0.01, seed=99, position=False, **TRUE)
    garbage = Log.from_arrays(
        "garbage", extra.time, extra.inputs, {"v": np.random.default_rng(4).normal(size=600)}, extra.channels
    )
    fit = output_error(ROBOT, LogSet([*clean, extra, garbage]), loss="cauchy")
    assert fit.log_status["garbage"].startswith("stands out") and fit.log_status["run 2"] == "fitted"
    assert any("garbage stands out" in note for note in fit.notes)
    for name, true in TRUE.items():
        assert fit[name].value == pytest.approx(true, rel=0.03)


def test_a_robust_loss_with_coloured_noise_and_the_robust_covariance(axis_log):
    clean, dirty, _ = runs(axis_log, 2)
    for logs in (clean, dirty):
        white = output_error(ROBOT, logs, loss="huber")
        robust = output_error(ROBOT, logs, loss="huber", covariance="robust")
        for name in TRUE:  # the noise is white: both covariances estimate the same
            assert 0.6 < robust[name].std_error / white[name].std_error < 1.5


@pytest.mark.parametrize("loss", LOSSES)
def test_a_coarse_sensor_on_a_robot_that_mostly_rests_has_no_outliers(axis_log, loss):
    """At rest model and sensor agree to the last digit; that says nothing of the scale of the rest."""
    clean = axis_log("rests", np.where(np.arange(600) % 300 < 200, 0.0, INPUTS), position=False, **TRUE)
    v = 0.02 * np.round(clean.output("v") / 0.02)
    fit = output_error(
        ROBOT, LogSet([Log.from_arrays("rests", clean.time, clean.inputs, {"v": v}, clean.channels)]), loss=loss
    )
    assert fit.outliers == ()
    for name, value in TRUE.items():
        assert abs(fit[name].value - value) < 4 * fit[name].std_error and fit[name].std_error < 0.1 * value
