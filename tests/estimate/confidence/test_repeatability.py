"""jaxid/estimate/repeatability.py: recordings of one axis, of which one was heavier, and of one that cannot be fitted."""

import numpy as np
import pytest

from jaxid import Axis, Integrator, Log, LogError, LogSet, repeatability

ROBOT = Axis().change("offset", free=False).with_values(M=1.0, Fv=2.0, Fc=0.5)
INPUTS = np.repeat([3.0, -2.0, 4.0, 0.8, -4.0, 1.5], 60)


def recordings(axis_log, masses, seed=0):
    return [
        axis_log(f"run {k}", np.roll(INPUTS, 60 * k), noise=0.01, seed=seed + k, position=False, M=mass)
        for k, mass in enumerate(masses)
    ]


def test_recordings_of_one_robot_agree(axis_log):
    found = repeatability(ROBOT, LogSet(recordings(axis_log, [1.0, 1.0, 1.0, 1.0])))
    assert found.disagreeing == () and "All 4 recordings agree" in found.sentence
    for name, true in {"M": 1.0, "Fv": 2.0, "Fc": 0.5}.items():
        assert abs(found.together[name].value - true) < 4 * found.together[name].std_error
        # Four recordings together know twice as much as one.
        ratio = found.together[name].std_error / np.mean([fit[name].std_error for fit in found.alone.values()])
        assert ratio == pytest.approx(0.5, rel=0.3)


@pytest.mark.slow
def test_p_values_are_uniform_for_repeatable_recordings(axis_log):
    p = []
    for seed in range(0, 30, 3):
        p += repeatability(ROBOT, LogSet(recordings(axis_log, [1.0] * 3, seed)), covariance="white").p_values.values()
    # Kolmogorov-Smirnov would ask for independence; three quarters of a flat distribution lie above 0.25.
    assert 0.55 < np.mean(np.array(p) > 0.25) < 0.92 and min(p) > 1e-4


def test_the_one_with_a_payload_is_pointed_out(axis_log):
    found = repeatability(ROBOT, LogSet(recordings(axis_log, [1.0, 1.0, 1.15, 1.0])))
    assert found.disagreeing == ("run 2",) and found.furthest["run 2"][0] == "M"
    assert found.furthest["run 2"][1] > 5 and "run 2" in found.sentence and "run 2" in repr(found)
    assert found.without["run 2"]["M"].value == pytest.approx(1.0, rel=0.01)


def wander(rng, clean):
    """Nothing that any axis would do."""
    return np.cumsum(rng.normal(size=clean.size))


def pushed(rng, clean):
    """An axis that somebody pushes about: half of what it does has to do with its input."""
    pushes = np.convolve(rng.normal(size=clean.size), np.exp(-np.arange(100) / 25), mode="full")[: clean.size]
    return clean + 0.7 * np.std(clean) * pushes / np.std(pushes) + 0.01 * rng.normal(size=clean.size)


@pytest.mark.parametrize("strange", [wander, pushed])
def test_a_recording_that_cannot_be_fitted_is_named_and_the_rest_stands(axis_log, strange):
    good = recordings(axis_log, [1.0, 1.0, 1.0])
    still = axis_log("wild", INPUTS, position=False, M=1.0, Fv=2.0, Fc=0.5)
    outputs = strange(np.random.default_rng(3), still.output("v"))
    wild = Log.from_arrays("wild", still.time, still.inputs, {"v": outputs}, still.channels)
    found = repeatability(ROBOT, LogSet([*good, wild]), integrator=Integrator(2))
    assert set(found.failed) == {"wild"} and set(found.p_values) == {"run 0", "run 1", "run 2"}
    assert all(len(fit.initial_states) == 2 and "wild" not in fit.initial_states for fit in found.without.values())
    assert "wild could not be fitted" in found.sentence
    with pytest.raises(LogError, match="two recordings"):
        repeatability(ROBOT, LogSet(good[:1]))
