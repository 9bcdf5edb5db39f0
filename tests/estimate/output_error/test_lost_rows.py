"""Rows that are missing where an input changed: a linear drive whose samples are known in closed form."""

import numpy as np
import pytest
from scipy.signal import lfilter

from jaxid import Axis, Log, LogSet, output_error
from jaxid.estimate.output_error.lost_rows import unknown_changes

SAMPLES, DT, NOISE = 400, 0.05, 0.05
ROBOT = Axis().with_values(M=1.0, Fv=1.0, Fc=0.0, offset=0.0).change("Fc", free=False).change("offset", free=False)
INPUTS = np.repeat(np.random.default_rng(4).uniform(-3, 3, (SAMPLES + 40) // 20), 20)


def without(rows, seed=0, noise=NOISE):
    """v' = u - v with held inputs, a log of the first 400 of its rows less `rows`."""
    decay = np.exp(-DT)
    v = np.append(0.0, lfilter([1 - decay], [1, -decay], INPUTS[:-1]))
    measured = v + noise * np.random.default_rng(seed).normal(size=len(v))
    kept = np.setdiff1d(np.arange(len(v)), rows)[:SAMPLES]
    time = DT * np.arange(len(v))
    return LogSet([Log.from_arrays("run", time[kept], INPUTS[kept, None], measured[kept, None], "axis")])


CHANGES = np.arange(20, 400, 20)


def test_inputs_that_changed_in_missing_rows_are_said_with_how_far_that_may_lead():
    fit = output_error(ROBOT, without(CHANGES))
    (text,) = [note for note in fit.notes if "Rows are missing" in note]
    assert f"{len(CHANGES)} time(s)" in text and f"t = {19 * DT:.4g} s" in text
    # The drive really got its inputs up to a row earlier than the log says.
    off = {name: abs(fit[name].value - 1.0) / fit[name].std_error for name in ("M", "Fv")}
    worst = max(off, key=lambda name: off[name])
    assert off[worst] > 1.8 and f"{worst} may be off" in text
    assert 0.3 < float(text.partition("off for that by ")[2].split()[0]) / off[worst] < 3.0


@pytest.mark.parametrize("rows", [np.array([], int), CHANGES + 10])
def test_rows_that_miss_no_change_of_an_input_are_no_news(rows):
    fit = output_error(ROBOT, without(rows))
    assert not any("Rows are missing" in note for note in fit.notes)
    assert all(abs(fit[name].value - 1.0) < 4 * fit[name].std_error for name in ("M", "Fv"))


def of_two_clocks(gone=()):
    """Speeds and inputs at 20 Hz without the rows `gone`, a yaw rate at 80 Hz from 3 ms on, in one table of both clocks."""
    first, second = 0.05 * np.setdiff1d(np.arange(100), gone), 0.003 + 0.0125 * np.arange(400)
    time, order = np.unique(np.concatenate([first, second]), return_index=True)
    own = order < len(first)
    row = np.maximum(np.searchsorted(first, time, side="right") - 1, 0)
    u = np.random.default_rng(3).uniform(-1.0, 1.0, (100, 2))[np.round(first / 0.05).astype(int)][row]
    v = np.where(own, 0.1, np.nan)
    return LogSet([Log.from_arrays("run", time, u, {"v": v, "w": np.where(own, np.nan, 0.2)}, "differential")])


def test_the_clocks_of_two_sensors_in_one_table_are_no_missing_rows():
    (none,) = unknown_changes(of_two_clocks())
    assert len(none) == 0
    logs = of_two_clocks(gone=[30, 31, 60])
    (there,) = unknown_changes(logs)
    np.testing.assert_allclose(logs[0].time[there + 1], [1.6, 3.05])


def test_a_sensor_that_misses_samples_is_no_other_clock():
    u = np.repeat(np.random.default_rng(5).uniform(-1.0, 1.0, (10, 2)), 20, axis=0)
    v = np.full(200, 0.1)
    v[19::20] = np.nan  # before every change of the inputs
    (none,) = unknown_changes(
        LogSet([Log.from_arrays("run", DT * np.arange(200), u, {"v": v, "w": 0.2 * u[:, 0]}, "differential")])
    )
    assert len(none) == 0
