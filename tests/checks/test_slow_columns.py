"""Columns that are slower than their log, as places and headings are: alive, or dead all the same."""

import numpy as np
import pytest

from jaxid import Channels, Log, LogSet
from jaxid.checks.preflight import preflight

DT, N = 0.02, 1000
UNITS = {"right": "m/s", "left": "m/s", "x": "m", "y": "m", "heading": "deg"}
CHANNELS = Channels(("right", "left"), ("x", "y", "heading"), (), UNITS)
TIME = DT * np.arange(N)


def rover(seed, every=10):
    """A base whose tracks follow their commands at once, in closed form: a curve of constant radius for every command."""
    rng = np.random.default_rng(seed)
    commands = np.repeat(rng.uniform(-0.8, 0.8, (40, 2)) + 0.3, 25, axis=0)
    v, w = commands.mean(axis=1), (commands[:, 0] - commands[:, 1]) / 0.9
    heading = np.concatenate([[0.0], np.cumsum(w * DT)])
    chord = v * DT * np.sinc(w * DT / (2 * np.pi))
    middle = heading[:-1] + 0.5 * w * DT
    place = np.concatenate([[0j], np.cumsum(chord * np.exp(1j * middle))])[:N]
    seen = np.stack([place.real, place.imag, np.degrees(heading[:N])], axis=1) + rng.normal(size=(N, 3)) * (
        0.01,
        0.01,
        0.5,
    )
    seen[np.arange(N) % every != 0, :2] = np.nan
    seen[np.arange(N) % (every // 2) != 0, 2] = np.nan
    return commands, seen


def found(commands, seen, check):
    logs = LogSet([Log.from_arrays("run", TIME, commands, seen, CHANNELS)])
    return [f.column for f in logs.preflight() if f.check == check]


@pytest.mark.parametrize("every", [4, 10])
def test_a_place_seen_now_and_then_is_not_dead_and_rustle_is(every):
    """Of a hundred samples noise may follow something by chance: nearly all of it is found, and nothing that lives."""
    dead = 0
    for seed in range(20):
        commands, seen = rover(seed, every)
        assert found(commands, seen, "dead_sensor") == []
        assert found(commands, seen, "idle") == []
        seen[::every, 1] = 0.5 * np.random.default_rng(100 + seed).normal(size=len(seen[::every]))
        dead += found(commands, seen, "dead_sensor") == ["y"]
    assert dead >= 17


@pytest.mark.parametrize("seed", range(5))
def test_a_heading_that_jumps_at_every_turn_is_said(seed):
    commands, seen = rover(seed)
    seen[:, 2] += 180.0 - np.nanmean(seen[:, 2])  # to and fro across half a turn
    wrapped = np.column_stack([seen[:, :2], (seen[:, 2] + 180) % 360 - 180])
    assert np.nanmax(seen[:, 2]) > 180
    assert found(commands, wrapped, "turns") == ["heading"]
    assert found(commands, seen, "turns") == []


@pytest.mark.parametrize(("lost", "check"), [(slice(400, 404), "slow_sensor"), (slice(400, 600), "missing_samples")])
def test_single_lost_samples_of_a_slow_sensor_are_no_stretch(lost, check):
    commands, seen = rover(0, every=4)
    seen[lost, 0] = np.nan
    log = Log.from_arrays("run", TIME, commands, seen, CHANNELS)
    (one,) = [f for f in preflight(log) if f.column == "x" and f.check in ("slow_sensor", "missing_samples")]
    assert one.check == check
    assert check == "missing_samples" or "one row in 4" in one.message and "(1 sample(s) of it left out)" in one.message
