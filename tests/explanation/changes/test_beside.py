"""Two things that changed at once, one of them where two separate fits cannot follow it: both are named, with their sizes, and
what is left is noise in the sensor's own units."""

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from jaxid import Channels, Custom, Log, LogSet, Parameter, explain_change, output_error
from jaxid.effects import laws_of
from jaxid.explanation.changes import beside
from jaxid.explanation.changes.candidates import Candidate, both, candidates_of, of_mechanism
from jaxid.explanation.changes.first_look import Score

CHANNELS = Channels(("u",), ("v",), (), {"u": "V", "v": "m/s"})
ROBOT = Custom(
    dynamics=lambda state, inputs, p: {"v": (p["K"] * inputs["u"] - state["v"]) / p["T"]},
    state_names=("v",),
    own_channels=CHANNELS,
    table={"T": Parameter(0.3, "s", lower=0.0, free=True), "K": Parameter(0.1, "m/(V s)", free=True)},
)


def logs_of(seed, T=0.3, bias=0.0, colour=0.0):
    """A first-order drive in closed form, with a sensor's bias and noise of 0.005 m/s whose neighbours are so correlated."""
    rng, found = np.random.default_rng(seed), []
    for k in range(3):
        u, v, seen = np.repeat(rng.uniform(-10.0, 10.0, 20), 15), 0.0, []
        for final in 0.1 * u:
            seen.append(v)
            v = final + (v - final) * np.exp(-0.02 / T)
        noise = 0.005 * rng.normal(size=300)
        for i in range(1, 300):
            noise[i] = colour * noise[i - 1] + np.sqrt(1.0 - colour**2) * noise[i]
        read = np.array(seen) + bias + noise
        found.append(Log.from_arrays(f"run {k}", 0.02 * np.arange(300), u[:, None], read[:, None], CHANNELS))
    return LogSet(found)


@cache
def before(colour=0.0):
    logs = logs_of(0, colour=colour)
    return output_error(ROBOT, logs), logs


def compared(colour=0.0, **changed):
    after = logs_of(1, colour=colour, **changed)
    fit, logs = before(colour)
    return explain_change(fit, output_error(ROBOT, after), logs, after)


@pytest.mark.slow
def test_a_bias_beside_a_slower_drive_is_no_slow_noise():
    """Two fits of the model cannot have a bias: what is left would pass for noise, and the drive's change for all there is."""
    found = compared(T=0.36, bias=0.01)
    assert found.verdict == "named" and found.change is not None and found.only_noise and not found.unsound
    assert {part.id for part in found.change.parts} == {"T", "sensor_bias"}
    sizes = {name: d.size for name, d in found.change.differences.items()}
    (bias,) = (size for name, size in sizes.items() if "bias" in name)
    assert abs(sizes["T"].value - 0.06) < 4.0 * sizes["T"].std_error
    assert abs(bias.value - 0.01) < 4.0 * bias.std_error
    assert found.change.rms == pytest.approx(1.0, abs=0.05) and found.rms_unchanged > 1.8


@pytest.mark.slow
def test_slow_noise_is_no_bias():
    """Coloured noise of both sets stays noise beside a change."""
    found = compared(colour=0.9, T=0.36)
    assert found.verdict == "named" and found.change is not None and not found.change.parts
    assert found.change.id == "T"
    size = found.change.differences["T"].size
    assert abs(size.value - 0.06) < 4.0 * size.std_error


@pytest.mark.slow
def test_where_no_second_change_can_be_so_large_none_is_named(monkeypatch):
    """What two would have to change by is more than either can: that is no end of the comparison."""
    monkeypatch.setattr(Candidate, "believable", lambda self, delta: not self.parts)
    found = compared(T=0.36, bias=0.01)
    assert found.change is None or not found.change.parts


def test_a_curve_beside_another_change_is_asked_by_its_formula(monkeypatch):
    """By the formula of the same side alone, and not where it has been tried."""
    laws = {law.law: law for law in laws_of(ROBOT, "voltage_saturation")}
    drive = candidates_of(ROBOT)[0]
    curve, formula, gone = (
        of_mechanism(laws[law], ROBOT, side)
        for law, side in (("shape", "after"), ("tanh", "after"), ("tanh", "before"))
    )
    scores = [
        Score(c, 1.0, 0.0, np.zeros(len(c.coordinates)), np.ones(len(c.coordinates)), np.zeros((1, 1)), c is drive)
        for c in (drive, curve, formula, gone)
    ]
    asked = []
    monkeypatch.setattr(
        beside, "_beside", lambda pair, first, second, joint, kept, colours: asked.append((first, second, kept))
    )

    def tried(*pairs):
        return [
            SimpleNamespace(
                total=float(k),
                score=SimpleNamespace(candidate=both(*pair)),
                joint=SimpleNamespace(delta=np.arange(sum(len(part.coordinates) for part in pair))),
            )
            for k, pair in enumerate(pairs)
        ]

    by_candidate = {score.candidate: score for score in scores}
    look = SimpleNamespace(scores=scores)
    found = beside._by_fewer_numbers(None, look, tried((drive, curve)), by_candidate, None)
    assert [score.candidate for score, _ in found] == [formula]
    ((first, second, kept),) = asked
    assert (first.candidate, second.candidate) == (drive, formula)
    assert np.array_equal(kept, np.arange(len(drive.coordinates)))
    assert not beside._by_fewer_numbers(None, look, tried((drive, curve), (drive, formula)), by_candidate, None)
    assert not beside._by_fewer_numbers(None, look, tried((drive, formula), (drive, curve)), by_candidate, None)
