"""The noise level from the data alone."""

import numpy as np
import pytest

from jaxid import AXIS, Axis, Log, LogSet, noise_level, simulate
from jaxid.logs import noise_scale
from jaxid.logs.noise import noise_error, sensor_step


def levels(n, seed, hold=25):
    return np.repeat(np.random.default_rng(seed).uniform(-3, 3, -(-n // hold)), hold)[:n]


def test_white_noise_on_a_smooth_motion_is_found(axis_log):
    logs = LogSet([axis_log(f"{k}", levels(1000, k), noise=0.01, seed=k) for k in range(3)])
    # 3 x 1000 samples; the median's relative standard error is about 1.17 / sqrt(2 x 3000), and third differences
    # of neighbours are correlated: 5 % is four of them
    for channel in ("v", "q"):
        assert noise_level(logs)[channel] == pytest.approx(0.01, rel=0.05)


@pytest.mark.parametrize("robot", ["pioneer", "omni"])
def test_the_demonstration_logs_noise_is_found(demo_logs, robot):
    found = noise_level(demo_logs(robot))
    truth = {"eta1": 0.01, "eta2": 0.02, "V": 0.01, "Vn": 0.01, "W": 0.02}
    for channel in demo_logs(robot).channels.outputs:
        assert found[channel] == pytest.approx(truth[channel], rel=0.05)


def test_kinks_at_input_changes_and_single_spikes_do_not_count(axis_log):
    log = axis_log("kinks", levels(2000, 5, hold=20), noise=1e-4, seed=5, M=2.0)
    assert noise_level(log)["v"] == pytest.approx(1e-4, rel=0.1)
    outputs = log.outputs.copy()
    outputs[::97] += 1.0
    spiky = type(log).from_arrays("spikes", log.time, log.inputs, outputs, "axis")
    assert noise_level(spiky)["v"] == pytest.approx(1e-4, rel=0.2)


def test_different_noise_in_different_logs_is_their_root_mean_square(axis_log):
    logs = LogSet(
        [axis_log("a", levels(1500, 6), noise=0.01, seed=6), axis_log("b", levels(1500, 7), noise=0.03, seed=7)]
    )
    assert noise_level(logs)["v"] == pytest.approx(np.sqrt((0.01**2 + 0.03**2) / 2), rel=0.06)


def test_missing_samples_are_left_out_and_an_absent_channel_has_no_noise(axis_log):
    log = axis_log("gaps", levels(1000, 8), noise=0.01, seed=8, position=False)
    outputs = log.outputs.copy()
    outputs[100:300, 0] = np.nan
    gaps = type(log).from_arrays("gaps", log.time, log.inputs, outputs, "axis")
    found = noise_level(gaps)
    assert found["v"] == pytest.approx(0.01, rel=0.12)
    assert np.isnan(found["q"])


def test_a_coarsely_quantised_signal_still_has_a_level():
    from jaxid import Log

    time = 0.02 * np.arange(400)
    step = 0.1
    outputs = np.round(0.01 * np.arange(400) / step) * step  # a staircase: most differences are zero
    found = noise_level(Log.from_arrays("steps", time, np.zeros((400, 1)), outputs[:, None], "axis"))["v"]
    assert 0.1 * step < found < step


def motion(n, seed=0):
    """A speed that follows its input within 0.3 s, sampled at 200 Hz, and the input."""
    inputs = levels(n, seed, hold=100)
    decay = np.exp(-0.005 / 0.3)
    speed = np.zeros(n)
    for k in range(1, n):
        speed[k] = inputs[k - 1] + (speed[k - 1] - inputs[k - 1]) * decay
    return inputs, speed


def measured(inputs, speed):
    return Log.from_arrays("m", 0.005 * np.arange(len(speed)), inputs[:, None], speed[:, None], AXIS)


@pytest.mark.parametrize("every", [2, 5, 10])
def test_samples_that_a_slower_sensor_repeats_count_once(every):
    inputs, speed = motion(4000)
    values = speed + 0.01 * np.random.default_rng(1).normal(size=4000)
    held = values[np.arange(4000) // every * every]
    # 400 values at least, of whose differences two in three count: the standard error is below 8 %
    assert noise_level(measured(inputs, held))["v"] == pytest.approx(0.01, rel=0.25)


@pytest.mark.parametrize("step", [0.003, 0.03, 0.3])
@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_an_encoder_is_no_finer_than_its_step(step, noise):
    inputs, speed = motion(4000)
    read = np.round((speed + noise * np.random.default_rng(2).normal(size=4000)) / step) * step
    truth = np.std(read - speed)
    assert 0.8 * truth < noise_level(measured(inputs, read))["v"] < 1.5 * truth


def test_a_counter_that_runs_and_creeps_is_no_finer_than_its_step():
    """Most values are read once or never; where it creeps, third differences see less than the step's rounding error."""
    time, step = 0.002 * np.arange(5000), 2e-4
    way = np.cumsum(np.where(time < 7.0, 0.11, 0.6 * np.sin(time)) * 0.002)
    log = Log.from_arrays("counts", time, np.zeros((5000, 1)), {"q": np.floor(way / step) * step}, AXIS)
    assert noise_level(log)["q"] == pytest.approx(step / np.sqrt(12), rel=0.02)


def test_a_robot_at_rest_does_not_lower_the_noise():
    inputs, speed = motion(4000)
    read = speed + 0.01 * np.random.default_rng(3).normal(size=4000)
    read[1000:] = 0.0  # an encoder of a wheel that stands
    assert noise_level(measured(inputs, read))["v"] == pytest.approx(0.01, rel=0.15)


def test_the_scale_is_that_of_the_noise_in_any_unit_and_never_zero(axis_log):
    log = axis_log("a", levels(600, 9), noise=0.01, seed=9, position=False)
    for unit in (1e-3, 1.0, 1e3):
        other = Log.from_arrays("a", log.time, log.inputs, log.outputs[:, :1] * unit, AXIS)
        assert noise_scale(other)["v"] == pytest.approx(unit * noise_scale(log)["v"], rel=1e-9)
    still = Log.from_arrays("a", log.time, log.inputs, np.zeros((600, 1)), AXIS)
    assert noise_scale(still)["v"] > 0
    both = axis_log("b", levels(600, 9), noise=0.02, seed=9)
    assert noise_scale(log, otherwise=both)["q"] == noise_scale(both)["q"]  # never measured here


def test_uneven_times_are_no_noise():
    """A motion that is smooth in time is not smooth from row to row where rows are lost."""
    rng = np.random.default_rng(10)
    inputs, speed = motion(4000)
    kept = np.sort(rng.choice(4000, 2800, replace=False))
    read = (speed + 0.001 * rng.normal(size=4000))[kept]
    log = Log.from_arrays("m", 0.005 * kept, inputs[kept, None], read[:, None], AXIS)
    assert noise_level(log)["v"] == pytest.approx(0.001, rel=0.15)
    shaken = np.cumsum(0.005 * rng.uniform(0.2, 1.8, 2000))
    wave = 0.3 * np.sin(6.0 * shaken) + 1e-4 * rng.normal(size=2000)
    log = Log.from_arrays("m", shaken, np.zeros((2000, 1)), wave[:, None], AXIS)
    assert noise_level(log)["v"] == pytest.approx(1e-4, rel=0.1)


def test_the_levels_own_error_is_what_it_scatters_by(axis_log):
    """Over 300 noises on one motion; their spread is itself known to 4 %."""
    clean = axis_log("run", levels(300, 1), position=False)
    rng = np.random.default_rng(2)
    noisy = [
        Log.from_arrays("run", clean.time, clean.inputs, clean.output("v") + 0.01 * rng.normal(size=300), AXIS)
        for _ in range(300)
    ]
    found = [noise_level(log)["v"] for log in noisy]
    assert noise_error(noisy[0])["v"] == pytest.approx(np.std(found) / np.mean(found), rel=0.15)
    assert np.isnan(noise_error(noisy[0])["q"])  # of which nothing was measured


@pytest.mark.parametrize("every", [2, 5])
def test_a_slower_sensor_that_leaves_cells_empty_has_its_own_neighbours(every):
    """As the pre-flight check of a slow sensor advises."""
    inputs, speed = motion(4000)
    values = speed + 0.01 * np.random.default_rng(1).normal(size=4000)
    values[np.arange(4000) % every > 0] = np.nan
    assert noise_level(measured(inputs, values))["v"] == pytest.approx(0.01, rel=0.25)


@pytest.mark.parametrize("samples", [2, 3, 4])
def test_a_log_too_short_for_third_differences_shows_no_level(samples):
    """And can be simulated: a planned step from one sample to the next is a log, too."""
    log = Log.from_arrays("short", 0.02 * np.arange(samples), np.ones(samples), np.ones(samples), Axis())
    assert np.isnan(noise_level(log)["v"])
    speeds = simulate(Axis().with_values(Fv=0.0, Fc=0.0), LogSet([log]), start={"q": np.zeros(1), "v": np.zeros(1)})
    np.testing.assert_allclose(speeds[0][:, 0], 0.02 * np.arange(samples))  # a force of 1 N on 1 kg


def test_windows_of_a_few_samples_tell_the_noise_together():
    """Each by itself has too few differences; a fit in windows of eight samples took its noise for none."""
    from jaxid.logs.windows import in_windows

    rng, time = np.random.default_rng(8), 0.02 * np.arange(800)
    values = np.sin(2.0 * time) + 0.05 * rng.normal(size=800)
    whole = LogSet([Log.from_arrays("run", time, np.ones((800, 1)), {"v": values}, "axis")])
    windows = in_windows(whole, 0.16)
    assert max(map(len, windows)) <= 9
    assert noise_level(windows)["v"] == pytest.approx(noise_level(whole)["v"], rel=0.15)
    assert noise_level(windows)["v"] == pytest.approx(0.05, rel=0.2)


@pytest.mark.parametrize("form", ["%.7g", "%.4f", "%.9g"])
def test_the_step_of_an_encoder_is_found_whatever_digits_its_file_has(form):
    step, rng = 2 * np.pi / 500, np.random.default_rng(4)
    angle = np.cumsum(0.04 * np.sin(np.arange(1000) / 60.0) + 0.03) + 0.1 * rng.standard_normal(1000)
    read = np.array([float(form % value) for value in step * np.round(angle / step)])
    assert sensor_step(read) == pytest.approx(step, rel=1e-4)
    assert sensor_step(angle) == 0.0


def test_a_speed_that_single_precision_makes_of_counts_in_more_than_one_way_has_their_step():
    """Of the sum of two wheels' counts, or of their two speeds: the same number is not the same to the last digit."""
    rng, rim = np.random.default_rng(5), np.float32(0.1651 * 0.0582)
    left, right = (np.round(20.0 * np.sin(np.arange(400) / 40.0) + 4.0 * rng.normal(size=400)) for _ in range(2))
    of_sum = (left + right).astype(np.float32) * rim * np.float32(0.5)
    of_each = (
        left.astype(np.float32) * (rim / np.float32(3.0)) + right.astype(np.float32) * (rim / np.float32(3.0))
    ) * np.float32(1.5)
    speed = np.where(rng.random(400) < 0.5, of_sum, of_each).astype(float)
    assert len(np.unique(speed)) > 1.2 * len(np.unique(left + right))
    assert sensor_step(speed) == pytest.approx(0.5 * 0.1651 * 0.0582, rel=1e-4)
    assert sensor_step(speed + 1e-4 * rng.normal(size=400)) == 0.0


def test_a_signal_that_changes_evenly_has_no_step():
    ramp = 0.3 * np.arange(40) + 1e-4 * np.random.default_rng(2).standard_normal(40)
    assert sensor_step(ramp) == 0.0 and sensor_step(ramp[:5]) == 0.0
    # A counter that runs evenly repeats a value now and then, or skips one.
    assert sensor_step(0.1 * np.floor(0.73 * np.arange(40))) == pytest.approx(0.1)
    assert sensor_step(0.1 * np.floor(1.73 * np.arange(40))) == pytest.approx(0.1)
