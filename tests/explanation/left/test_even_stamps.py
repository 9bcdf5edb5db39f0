"""Stamps that scatter about the robot's own clock, and clocks that are uneven themselves, on an axis in closed form."""

import numpy as np
import pytest

from jaxid import AXIS, Axis, Log, LogSet, explain, output_error
from jaxid.logs.even_clock import scatter

SAMPLES, DT = 600, 0.02


def runs(axis_law, scattered, bias=0.0, count=4):
    """Sampled evenly and stamped up to `scattered` seconds early or late; a sensor `bias`."""
    logs = []
    for k in range(count):
        rng = np.random.default_rng([3, k])
        u = np.repeat(rng.uniform(-4, 4, SAMPLES // 10), 10)
        time = DT * np.arange(SAMPLES) + rng.uniform(-scattered, scattered, SAMPLES)
        outputs = {"v": axis_law(u, DT)[0] + 0.003 * rng.normal(size=SAMPLES) + bias}
        logs.append(Log.from_arrays(f"run {k}", time - time[0], u[:, None], outputs, AXIS))
    return LogSet(logs[: count - 1]), LogSet(logs[count - 1 :])


@pytest.mark.parametrize("scattered", [0.002, 0.007])
def test_nothing_is_missing_where_stamps_alone_are_wrong(axis_law, scattered):
    logs, held_out = runs(axis_law, scattered)
    found = explain(output_error(Axis(), logs), logs, held_out)
    assert found.verdict == "adequate"
    assert [note for note in found.notes if note.startswith("The stamps of 4 of 4 logs scatter about an even clock")]


@pytest.mark.slow
def test_what_is_missing_beside_wrong_stamps_is_named(axis_law):
    logs, held_out = runs(axis_law, 0.007, bias=0.02)
    found = explain(output_error(Axis(), logs), logs, held_out)
    assert [effect.id for effect in found.effects] == ["sensor_bias"] and found.verdict in ("named", "ambiguous")
    (bias,) = found.effects[0].parameters.values()
    assert bias.value == pytest.approx(0.02, abs=4 * bias.std_error)


@pytest.mark.slow
def test_a_clock_that_is_uneven_itself_is_left_alone(axis_law):
    """Samples taken, and commands held, at the times that the stamps say."""
    steps, logs = 10, []
    for k in range(4):
        rng = np.random.default_rng([5, k])
        held = rng.integers(7, 14, SAMPLES)
        u = np.repeat(rng.uniform(-4, 4, SAMPLES // 10), 10)
        rows = np.concatenate([[0], np.cumsum(held)[:-1]])
        fine = axis_law(np.repeat(u, held), DT / steps)[0][rows]
        outputs = {"v": fine + 0.003 * rng.normal(size=SAMPLES) + 0.02}
        logs.append(Log.from_arrays(f"run {k}", rows * DT / steps, u[:, None], outputs, AXIS))
    logs, held_out = LogSet(logs[:3]), LogSet(logs[3:])
    found = explain(output_error(Axis(), logs), logs, held_out)
    assert [effect.id for effect in found.effects] == ["sensor_bias"]
    assert not [note for note in found.notes if "even clock" in note]


def test_the_even_clock_is_that_of_the_rows_where_some_are_missing(axis_law):
    rng = np.random.default_rng(2)
    kept = np.sort(rng.choice(SAMPLES, SAMPLES - 40, replace=False))
    true = 5.0 + DT * kept
    stamps = true + 0.0015 * rng.standard_normal(len(kept)).clip(-2, 2)
    log = Log.from_arrays("run", stamps, np.zeros((len(kept), 1)), {"v": np.zeros(len(kept))}, AXIS)
    even, size = scatter(log)
    assert np.abs(even - true).max() < 0.001 and size == pytest.approx(0.075, rel=0.15)
    late = Log.from_arrays("run", true, np.zeros((len(kept), 1)), {"v": np.zeros(len(kept))}, AXIS)
    assert scatter(late)[1] == 0.0
