"""Coloured noise of a sensor is no missing effect, and hides none: an axis in closed form, and residuals made up."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

import jaxid
from jaxid import AXIS, Axis, Log, LogSet, explain, output_error
from jaxid.estimate.noise_colour import Colour
from jaxid.explanation.left.coloured import OnlyColour, colours_of, mostly_rounding, only_colour, whitened
from jaxid.explanation.left.heldout import HeldOut
from jaxid.explanation.search.in_colour import generalised

SAMPLES, DT = 500, 0.02
ROBOT = Axis().with_values(M=1.0, Fv=2.0, Fc=0.5, offset=0.0)


def first_order(correlation, samples, rng, start=300):
    """Noise of unit variance whose neighbours have this correlation."""
    white = np.sqrt(1 - correlation**2) * rng.normal(size=samples + start)
    return signal.lfilter([1.0], [1.0, -correlation], white)[start:]


def boxcar(width, samples, rng):
    """Noise of unit variance, averaged over `width` samples."""
    return np.convolve(rng.normal(size=samples + width - 1), np.ones(width) / np.sqrt(width), "valid")


# -- what is left: made up -----------------------------------------------------------------------------------------
def left(residuals, inputs, speeds, noise=0.01):
    """Residuals [T] in units of the noise as states of a held-out log and the fitted ones."""
    logs = [
        Log.from_arrays(f"run {k}", DT * np.arange(len(r)), u, {"v": v - noise * r}, AXIS)
        for k, (r, u, v) in enumerate(zip(residuals, inputs, speeds, strict=True))
    ]
    rms = float(np.sqrt(np.mean(np.concatenate(residuals) ** 2)))
    state = HeldOut(rms, {"v": rms}, tuple(r[:, None] for r in residuals), {"v": noise}, 0.0)
    first = replace(state, residuals=state.residuals[:1]), LogSet(logs[:1])
    return [first, (replace(state, residuals=state.residuals[1:]), LogSet(logs[1:]))]


@pytest.fixture(scope="module")
def motions(axis_law):
    inputs = [np.repeat(np.random.default_rng(seed).uniform(-4, 4, 20), 25) for seed in range(3)]
    return [u[:, None] for u in inputs], [axis_law(u, DT)[0] for u in inputs]


def made(motions, make, seed=5):
    rng = np.random.default_rng(seed)
    return left([make(rng, u[:, 0], v) for u, v in zip(*motions, strict=True)], *motions)


def test_a_speed_from_differences_of_counts_leaves_rounding(motions):
    """Twice the error of one rounded value, half of it back in the next sample: its shape is that of the motion."""
    step, noise = 4e-4, 0.01

    def counted(rng, u, v):
        counts = np.floor(rng.uniform() + np.concatenate([[0.0], np.cumsum(v)]) * DT / step)
        return (v - np.diff(counts) * (step / DT)) / noise

    states = made(motions, counted)
    (colour,) = colours_of([state for state, _ in states]).values()
    assert colour.correlation < -0.3 and states[0][0].normalised_rms < 1.0
    assert mostly_rounding(states, "v", colour)
    # The same size and shape of a reading that is not counted, and a residual above its noise, are no rounding.
    drawn = made(motions, lambda rng, u, v: 0.8 * np.diff(rng.normal(size=SAMPLES + 1)) / np.sqrt(2.0))
    assert not mostly_rounding(drawn, "v", colour)
    louder = [(replace(state, by_channel={"v": 1.5}), logs) for state, logs in states]
    assert not mostly_rounding(louder, "v", colour)


def test_a_sensors_filter_is_told_from_what_may_be_a_disturbance(motions):
    filtered = only_colour(made(motions, lambda rng, u, v: 2.8 * first_order(0.8, SAMPLES, rng)), memory=25.0)
    assert filtered is not None and filtered.simple and filtered.faster
    averaged = only_colour(made(motions, lambda rng, u, v: 2.8 * boxcar(4, SAMPLES, rng)), memory=25.0)
    assert averaged is not None and averaged.simple and averaged.faster
    # As slow as the robot itself: its inertia would make the same of a random force.
    slow = only_colour(made(motions, lambda rng, u, v: 4.0 * first_order(0.96, SAMPLES, rng)), memory=25.0)
    assert slow is not None and not slow.faster
    # White noise beside something slow: a sensor's own noise is hardly both.
    both = only_colour(
        made(motions, lambda rng, u, v: 2.0 * first_order(0.96, SAMPLES, rng) + rng.normal(size=SAMPLES)), memory=25.0
    )
    assert both is not None and not both.simple


def test_a_filter_that_was_changed_between_two_days_is_a_sensors_on_both(motions):
    def own(rng, u, v):
        return 1.2 * first_order(0.6, SAMPLES, rng) if u[0] == FIRST else rng.normal(size=SAMPLES)

    found = only_colour(made(motions, own), memory=25.0)
    assert found is not None and found.simple and found.faster

    def slower(rng, u, v):  # as slow as the robot, on one log only: that may be its floor
        return 3.0 * first_order(0.97, SAMPLES, rng) if u[0] == FIRST else rng.normal(size=SAMPLES)

    found = only_colour(made(motions, slower), memory=25.0)
    assert found is None or not found.simple


def follows_speed(rng, u, v):
    return 2.8 * first_order(0.8, SAMPLES, rng) + 3.0 * v * np.abs(v) / np.std(v * np.abs(v))


def on_one_log(rng, u, v):
    # Not the sensor's: its differences are as small as ever.
    bump = 15.0 * np.exp(-0.5 * ((np.arange(SAMPLES) - 250) / 60) ** 2) if u[0] == FIRST else 0.0
    return first_order(0.5, SAMPLES, rng) + bump


FIRST = np.random.default_rng(0).uniform(-4, 4, 20)[0]


def test_noise_that_is_fed_back_may_follow_the_motion_and_is_not_called_the_sensors(motions):
    states = made(motions, lambda rng, u, v: 2.8 * first_order(0.6, SAMPLES, rng) + 0.9 * v / np.std(v))
    assert only_colour(states, memory=25.0) is None
    found = only_colour(states, memory=25.0, fed_back=True)
    assert found is not None and found.fed_back and not found.only_noise
    assert found.to_dict()["fed_back"] is True
    # What comes on one log only no sensor makes, fed back or not.
    assert only_colour(made(motions, on_one_log), memory=25.0, fed_back=True) is None


@pytest.mark.parametrize("make", [follows_speed, on_one_log])
def test_what_follows_the_motion_or_comes_on_one_log_is_no_noise(motions, make):
    assert only_colour(made(motions, make), memory=25.0) is None


def test_a_gyros_filter_is_found_beside_a_speed_that_is_counted_coarsely(motions):
    # Rounded coarsely, an error stays as long as the speed does: uneven, and no mark of anything missing.
    inputs, speeds = motions
    rng, step, noise, logs, residuals = np.random.default_rng(4), 0.24, 0.01, [], []
    channels = jaxid.Channels(inputs=("u",), outputs=("v", "w"))
    for k, (u, v) in enumerate(zip(inputs, speeds, strict=True)):
        counted = step * np.round((v + 0.1 * step * rng.normal(size=SAMPLES)) / step)
        gyro = noise * 2.5 * first_order(0.7, SAMPLES, rng)
        logs.append(Log.from_arrays(f"run {k}", DT * np.arange(SAMPLES), u, {"v": counted, "w": gyro}, channels))
        residuals.append(np.stack([(v - counted) / step, -gyro / noise], axis=1))
    sizes = {"v": step, "w": noise}
    rms = dict(zip(sizes, np.sqrt(np.mean(np.concatenate(residuals) ** 2, axis=0)).tolist(), strict=True))
    assert rms["v"] < 1.0 < rms["w"]
    state = HeldOut(float(np.hypot(*rms.values()) / np.sqrt(2)), rms, tuple(residuals), sizes, 0.0)
    states = [
        (replace(state, residuals=tuple(residuals[:1])), LogSet(logs[:1])),
        (replace(state, residuals=tuple(residuals[1:])), LogSet(logs[1:])),
    ]
    found = only_colour(states, memory=25.0)
    assert found is not None and found.of_sensors and set(found.colours) == {"w"}


def test_squares_of_whitened_residuals_count_independent_samples(motions):
    states = made(motions, lambda rng, u, v: 2.8 * first_order(0.8, SAMPLES, rng))
    found = only_colour(states, memory=25.0)
    white = whitened(states[1][0], found.colours)
    assert white.squares == pytest.approx(white.samples, rel=0.1)
    assert states[1][0].squares > 5 * white.squares


# -- the whole workflow --------------------------------------------------------------------------------------------
def recorded(axis_law, correlation, dead=0.0, seed=1):
    """Two logs to fit and one to check; the motor ignores commands below `dead`."""
    logs = []
    for k in range(3):
        rng = np.random.default_rng([seed, k])
        u = np.repeat(rng.uniform(-4, 4, SAMPLES // 20), 20)
        v, _ = axis_law(np.sign(u) * np.maximum(np.abs(u) - dead, 0.0), DT)
        y = v + 0.02 * first_order(correlation, SAMPLES, rng)
        logs.append(Log.from_arrays(f"run {k}", DT * np.arange(SAMPLES), u[:, None], {"v": y}, AXIS))
    return LogSet(logs[:2]), LogSet(logs[2:])


@pytest.mark.slow
def test_nothing_is_missing_where_only_the_sensors_noise_is_coloured(axis_law):
    for seed in (1, 2):
        logs, check = recorded(axis_law, 0.8, seed=seed)
        found = explain(output_error(ROBOT, logs), logs, check)
        assert found.verdict == "adequate" and not found.effects, seed
        assert found.before.normalised_rms > 2.0 and "coloured" in found.sentence
        assert found.colour.colours["v"].correlation == pytest.approx(0.8, abs=0.08)
        assert found.to_dict()["colour"]["channels"]["v"]["order"] == found.colour.colours["v"].order


@pytest.mark.slow
def test_nothing_is_missing_where_the_sensor_was_filtered_on_some_logs_only(axis_law):
    logs = []
    for k in range(6):
        rng = np.random.default_rng([9, k])
        u = np.repeat(rng.uniform(-4, 4, SAMPLES // 20), 20)
        noise = 0.01 * first_order(0.6 if k % 3 == 1 else 0.0, SAMPLES, rng)
        outputs = {"v": axis_law(u, DT)[0] + noise}
        logs.append(Log.from_arrays(f"run {k}", DT * np.arange(SAMPLES), u[:, None], outputs, AXIS))
    fitted, check = LogSet(logs[:4]), LogSet(logs[4:])
    found = explain(output_error(ROBOT, fitted), fitted, check)
    assert found.verdict == "adequate" and found.colour is not None and found.colour.simple


@pytest.mark.slow
def test_slow_noise_beside_white_noise_is_left_open_and_no_force_is_blamed(axis_law):
    logs = []
    for k in range(3):
        rng = np.random.default_rng([4, k])
        u = np.repeat(rng.uniform(1, 4, SAMPLES // 20) * rng.choice([-1, 1], SAMPLES // 20), 20)  # no rest between
        v, _ = axis_law(u, DT)
        y = v + 0.02 * rng.normal(size=SAMPLES) + 0.04 * first_order(0.96, SAMPLES, rng)
        logs.append(Log.from_arrays(f"run {k}", DT * np.arange(SAMPLES), u[:, None], {"v": y}, AXIS))
    found = explain(output_error(ROBOT, LogSet(logs[:2])), LogSet(logs[:2]), LogSet(logs[2:]))
    assert found.verdict == "unexplained" and not found.effects and found.localisation is None
    assert "follows nothing that drove the robot" in found.sentence and "at rest tells them apart" in found.sentence


@pytest.mark.slow
def test_coloured_noise_hides_no_effect(axis_law):
    logs, check = recorded(axis_law, 0.8, dead=0.4)
    found = explain(output_error(ROBOT, logs), logs, check)
    assert found.verdict == "named" and [effect.id for effect in found.effects] == ["actuator_dead_zone"]
    own = found.effects[0].parameters["threshold"]
    assert own.value == pytest.approx(0.4, abs=4 * own.std_error)
    assert found.colour is not None and found.gap_closed == pytest.approx(1.0)


@pytest.fixture(scope="module")
def slow_noise(axis_law):
    return recorded(axis_law, 0.95, seed=1)


def test_generalised_least_squares_reaches_what_the_coloured_noise_allows(slow_noise, axis_law):
    logs, _ = slow_noise
    fit = output_error(ROBOT, logs)
    colours = {"v": Colour((0.95,), np.sqrt(1 - 0.95**2), 0.95)}
    found = generalised(fit.robot, logs, {"v": 0.02}, colours).parameters
    names, truth = ("M", "Fv", "Fc"), (1.0, 2.0, 0.5)

    def white(values):
        speeds = [axis_law(log.inputs[:, 0], DT, **dict(zip(names, values, strict=True)))[0] for log in logs]
        return np.concatenate([v[1:] - 0.95 * v[:-1] for v in speeds]) / (0.02 * np.sqrt(1 - 0.95**2))

    # The Cramer-Rao bound of the true covariance, by the closed form's own differences.
    steps = 1e-4 * np.eye(3)
    jacobian = np.stack([(white(truth + step) - white(truth - step)) / 2e-4 for step in steps], axis=1)
    bound = np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)))
    off = np.array([found[name].value for name in names]) - truth
    assert np.all(np.abs(off) < 3.5 * bound)
    before = np.array([fit[name].value for name in names]) - truth
    assert np.max(np.abs(before) / bound) > 3.5  # output error weighs slow noise as if it were white


@pytest.mark.slow
def test_slow_noise_alone_is_explained_by_no_effect(slow_noise):
    logs, check = slow_noise
    found = explain(output_error(ROBOT, logs), logs, check)
    assert found.verdict == "adequate" and found.colour.colours["v"].correlation == pytest.approx(0.95, abs=0.03)


def test_noise_of_no_channel_has_words_all_the_same():
    """What noise of the inputs makes need be no longer than a sample on any channel."""
    assert OnlyColour({}, simple=False, faster=False).phrase == "no channel"
