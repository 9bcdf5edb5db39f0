"""Windows of logs, and inputs between samples."""

import numpy as np
import pytest

from jaxid import AXIS, Log, LogError, LogSet
from jaxid.logs.intersample import between_samples
from jaxid.logs.windows import in_windows


def _log(name: str, samples: int, seed: int = 0) -> Log:
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.uniform(0.005, 0.015, samples))
    return Log.from_arrays(name, time, rng.normal(size=samples), {"v": rng.normal(size=samples)}, AXIS)


def test_every_sample_is_in_one_window():
    logs = LogSet([_log("a", 203), _log("b", 90, 1)])
    windows = in_windows(logs, 0.2)
    times = [[t for w in windows if w.name.startswith(log.name) for t in w.time] for log in logs]
    for log, found in zip(logs, times, strict=True):
        np.testing.assert_array_equal(found, log.time)
    assert all(0.14 < w.duration < 0.26 for w in windows)
    assert len(set(windows.names)) == len(windows)


def test_a_log_no_longer_than_a_window_stays_whole():
    log = _log("short", 12)
    assert in_windows(LogSet([log]), 5.0)[0] is log


def test_windows_without_measurement_are_left_out():
    log = _log("gap", 100)
    outputs = log.outputs.copy()
    outputs[40:70] = np.nan
    gap = Log("gap", log.time, log.inputs, outputs, log.channels)
    windows = in_windows(LogSet([gap]), 0.1)
    assert 0 < len(windows) < 10
    assert all(np.isfinite(w.output("v")).sum() >= 3 for w in windows)


@pytest.mark.parametrize("seconds", [0.0, -1.0, float("nan"), "none"])
def test_a_length_that_is_none_is_refused(seconds):
    with pytest.raises(LogError, match="positive length"):
        in_windows(LogSet([_log("a", 30)]), seconds)


def test_linear_inputs_have_the_impulse_of_the_trapezium():
    log = _log("a", 50)
    (held,) = between_samples(LogSet([log]), "linear")
    dt = np.diff(log.time)
    np.testing.assert_allclose(np.cumsum(held.inputs[:-1, 0] * dt)[-1], np.trapezoid(log.inputs[:, 0], log.time))
    assert between_samples(LogSet([log]), "hold")[0] is log


@pytest.mark.wrong_types
def test_inputs_between_samples_are_held_or_linear():
    log = _log("a", 50)
    with pytest.raises(ValueError, match="'hold' or 'linear'"):
        between_samples(LogSet([log]), "cubic")  # type: ignore[arg-type]
