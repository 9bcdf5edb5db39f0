"""The localisation figure shows what was computed, with units on every axis."""

import matplotlib.colors as colours
import numpy as np
import pytest

from jaxid import AXIS, Log, LogSet
from jaxid.explanation.where.condition_shares import condition_shares
from jaxid.explanation.where.localise import Localisation
from jaxid.explanation.where.missing_force import ForceHistory
from jaxid.explanation.where.patterns import Pattern
from jaxid.report import figures
from jaxid.report.localisation_figures import localisation, worst_log


@pytest.fixture(scope="module")
def found():
    """Two logs; the second one's force acts under a condition that the first one's does not know."""
    rng = np.random.default_rng(6)
    time = np.arange(1000) * 0.02
    masks = {("slow", "at low speed"): [np.repeat(rng.random(40) < 0.25, 25) for _ in range(2)]}
    masks[("late", "late")] = [time > 12, time > 12]
    forces, logs = [], []
    for e in range(2):
        value = (np.where(masks["slow", "at low speed"][e], 1.0 + e, 0.1) + 0.02 * rng.normal(size=1000))[:, None]
        args = (("v",), ("N",), np.ones(1), np.ones(1))
        forces.append(ForceHistory(f"log {e}", time, value, np.full_like(value, 0.05), *args))
        logs.append(Log.from_arrays(f"log {e}", time, {"u": np.ones(1000)}, {"v": np.sin(time)}, AXIS))
    conditions = condition_shares(forces, masks)
    speed = Pattern("speed", "follows the speed", 0.7, 0.001, tuple(0.5 * force.force for force in forces))
    result = Localisation(
        {"v": 1.0}, {"v": 1.0}, conditions, (speed,), 0.2, {}, "A sentence.", {"v": "N"}, tuple(forces),
        tuple(masks["slow", "at low speed"]),
    )  # fmt: skip
    return result, LogSet(logs)


def test_the_worst_log_is_drawn_with_its_band_and_its_speed(found):
    result, logs = found
    assert worst_log(result) == 1
    figure = localisation(result, logs)
    force, speed = figure.axes[:2]
    np.testing.assert_array_equal(force.lines[0].get_ydata(), result.forces[1].force[:, 0])
    np.testing.assert_array_equal(speed.lines[0].get_ydata(), logs[1].output("v"))
    band = force.collections[0].get_paths()[0].vertices
    assert band[:, 1].max() == pytest.approx(np.max(result.forces[1].force + 1.96 * 0.05))
    assert "[N]" in force.get_ylabel() and "[m/s or rad/s]" in speed.get_ylabel()
    assert speed.get_xlabel() == "time in log 1 [s]"
    fitted = [line for line in force.lines if line.get_label() == "fitted to the speed"]
    np.testing.assert_array_equal(fitted[0].get_ydata(), result.patterns[0].fitted[1][:, 0])


def test_bars_are_the_ratios_and_what_stands_out_is_coloured(found):
    result, logs = found
    figure = localisation(result, logs)
    bars, shares = figure.axes[2:]
    shown = sorted(result.conditions, key=lambda c: -c.ratio)
    assert [bar.get_width() for bar in bars.patches] == [c.ratio for c in shown]
    assert [label.get_text() for label in bars.get_yticklabels()] == [c.name for c in shown]
    strong = [colours.same_color(bar.get_facecolor(), figures.COLOURS[1]) for bar in bars.patches]
    assert strong == [c.stands_out for c in shown] == [True, False]
    assert [bar.get_width() for bar in shares.patches] == pytest.approx([70.0])
    assert "[-]" in bars.get_xlabel() and "[%]" in shares.get_xlabel()
    assert figure.get_suptitle() == "A sentence."
    assert figures.as_png(figure)[:4] == b"\x89PNG"
