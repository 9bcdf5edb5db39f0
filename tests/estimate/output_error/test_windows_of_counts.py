"""Windows of counted positions, of a complete model and of one that lacks something."""

import numpy as np
import pytest

import jaxid
from tests.counted_runs import Hidden, logged, model

pytest.importorskip("numba", reason="the independent simulator needs numba")
STRIBECK = {"axis": 4.0, "own drive": 1.5, "pioneer": 0.4, "omni": 12.0}


@pytest.mark.parametrize(
    ("name", "counts", "seconds"),
    [
        ("axis", 2048, 1.0),
        pytest.param("own drive", 8192, 1.0, marks=pytest.mark.slow),
        pytest.param("pioneer", 512, 0.4, marks=pytest.mark.slow),
        pytest.param("omni", 4096, 1.0, marks=pytest.mark.slow),
    ],
)
def test_a_complete_model_is_believed_in_windows(name, counts, seconds):
    """Initial states that are estimated from a window leave what is not white; innovations are."""
    logs, _ = logged(name, counts, Hidden())
    fit = jaxid.output_error(model(name), logs, windows=seconds)
    assert fit.window == seconds and fit.trustworthy, fit.judgement
    # The noise that third differences show of the finest encoder holds quick motion as well.
    assert 0.6 < fit.judgement.normalised_rms < 1.1


@pytest.mark.parametrize(("name", "counts"), [("axis", 2048), pytest.param("own drive", 1024, marks=pytest.mark.slow)])
def test_windows_do_not_hide_what_a_model_lacks(name, counts):
    lacking = Hidden(effects=(("stribeck_friction", (("amplitude", STRIBECK[name]), ("speed", 0.05))),))
    logs, _ = logged(name, counts, lacking)
    fit = jaxid.output_error(model(name), logs, windows=1.0)
    assert not fit.trustworthy and fit.judgement.normalised_rms > 2


@pytest.mark.slow
def test_a_caster_driven_backwards_is_no_unstable_plant():
    """Its angle stands in no log; taken for zero while the robot reverses, it made every such log unstable."""
    from jaxid.estimate.output_error.predictability import predictability

    logs, _ = logged("pioneer", 2048, Hidden())
    assert predictability(model("pioneer"), logs).kind != "unstable"
    fit = jaxid.output_error(model("pioneer"), logs)
    assert fit.window is None and fit.trustworthy
    assert all(np.isfinite(fit[name].std_error) for name in ("I0", "Cs", "Cv"))
