"""An axis pushed forwards only, in closed form: while it moves the logs show Fc + offset, and at rest only that Fc holds it."""

import numpy as np
import pytest

from jaxid import Axis, Log, LogSet, output_error

SAMPLES, INTERVAL, NOISE = 400, 0.02, 0.01
M, FV, FC, OFFSET = 1.0, 2.0, 0.5, 0.0


def pushed(seed: int, reverse: bool) -> LogSet:
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(0.2, 4.0, 20) * rng.integers(0, 2, 20), 20)
    if reverse:
        u *= np.repeat(np.where(np.arange(10) % 2, -1.0, 1.0), 40)
    v, decay = np.zeros(SAMPLES), np.exp(-FV / M * INTERVAL)
    for k in range(SAMPLES - 1):  # exact under a held input, but for the sample in which it stops
        way = np.sign(v[k]) or np.sign(u[k])
        there = (u[k] - FC * way) / FV
        after = there + (v[k] - there) * decay
        v[k + 1] = after if after * way > 0 else 0.0
    return LogSet(
        [
            Log.from_arrays(
                "a", np.arange(SAMPLES) * INTERVAL, u[:, None], (v + NOISE * rng.normal(size=SAMPLES))[:, None], "axis"
            )
        ]
    )


@pytest.mark.parametrize(("Fc", "offset"), [(0.15, 0.4), (0.1, 0.5)])
def test_what_sticking_bounds_from_one_side_is_not_identified(Fc, offset):
    """From these starts the axis creeps back at rest, and the fit ends where it just does not any more: Fc = offset = 1/4, a
    hundred of its apparent standard errors off the truth."""
    fit = output_error(Axis().with_values(M=1.3, Fv=1.6, Fc=Fc, offset=offset), pushed(1, reverse=False))
    assert fit["Fc"].value + fit["offset"].value == pytest.approx(FC + OFFSET, abs=0.03)
    assert abs(fit["Fc"].value - FC) > 0.1  # what this is about
    for name, true in (("Fc", FC), ("offset", OFFSET)):
        assert fit[name].status == "not_identifiable" and np.isinf(fit[name].std_error)
        low, high = fit[name].ci95
        assert low < true < high and np.isfinite([low, high]).sum() == 1
        assert any(note.startswith(f"{name}: ") and "one side only" in note for note in fit.notes)
    assert fit["M"].status == fit["Fv"].status == "identified"
    assert "inf" in repr(fit) and fit.judgement.verdict == "sound"


def test_what_only_shows_in_a_sum_is_said_and_has_no_standard_error():
    fit = output_error(Axis().with_values(M=1.3, Fv=1.6, Fc=0.5, offset=0.1), pushed(1, reverse=False))
    assert fit["Fc"].status == fit["offset"].status == "not_identifiable"
    assert np.isinf(fit["Fc"].std_error) and fit["Fc"].ci95 == (0.0, np.inf)
    assert any("Fc and offset one by one" in note for note in fit.notes)


def test_motion_both_ways_identifies_both():
    fit = output_error(Axis().with_values(M=1.3, Fv=1.6, Fc=0.15, offset=0.4), pushed(1, reverse=True))
    assert not any("one side" in note or "one by one" in note for note in fit.notes)
    for name, true in (("M", M), ("Fv", FV), ("Fc", FC), ("offset", OFFSET)):
        assert fit[name].status == "identified" and abs(fit[name].value - true) < 4 * fit[name].std_error
