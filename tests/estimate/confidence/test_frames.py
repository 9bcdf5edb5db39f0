"""Results of questions about one fit as data frames: what they hold is what the results say."""

import numpy as np
import pytest

import jaxid


@pytest.fixture(scope="module")
def logs(axis_log):
    inputs = np.repeat(np.random.default_rng(3).uniform(-2, 2, 25), 10)
    return jaxid.LogSet([axis_log(name, inputs, 0.02, seed, position=False, Fc=0.3) for seed, name in enumerate("ab")])


def test_profiles_and_what_the_logs_determine(logs):
    fit = jaxid.output_error(jaxid.Axis(), logs)
    found = jaxid.profile_likelihood(fit, logs)
    frame = found.to_pandas()
    assert list(frame.index) == list(found.profiles) and frame.loc["M", "unit"] == "kg"
    assert tuple(frame.loc["M", ["ci95_low", "ci95_high"]]) == found["M"].ci95
    expected = jaxid.identifiability(jaxid.Axis(), logs)
    assert expected.to_pandas().loc["Fv", "std_error"] == expected.std_errors["Fv"]


def test_recordings_and_starts(logs):
    found = jaxid.repeatability(jaxid.Axis(), logs)
    frame = found.to_pandas().set_index(["log", "parameter"])
    assert frame.loc[("a", "M"), "value"] == found.alone["a"]["M"].value
    assert frame.loc[("b", "M"), "p_value"] == found.p_values["b"] and np.isnan(frame.loc[("", "M"), "p_value"])
    several = jaxid.multi_start(jaxid.Axis(), logs)
    basins = several.to_pandas()
    assert list(basins["starts"]) == [basin.starts for basin in several.basins]
    assert basins.loc[0, "M"] == several.basins[0].parameters["M"]


def test_an_origin_is_a_few_lines(logs):
    shown = repr(jaxid.output_error(jaxid.Axis(), logs).origin)
    assert len(shown.splitlines()) == 4 and shown.startswith("Computed by jaxid.output_error(")
    assert logs[0].sha256[:12] in shown
