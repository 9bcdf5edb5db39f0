"""The noise level from the data alone."""

import numpy as np
import pytest

from jaxid import LogSet, noise_level


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
