"""Design of experiments, on a drive axis whose sensitivities are known in closed form."""

from html import unescape

import numpy as np
import pandas as pd
import pytest
from scipy.signal import cont2discrete, lfilter

from jaxid import (
    Axis,
    DesignError,
    Log,
    LogSet,
    Omni,
    Pioneer,
    design_experiment,
    identifiability,
    output_error,
    read_logs,
    simulate,
)
from jaxid.design.information import Laboratory, criterion, known, std_errors
from jaxid.design.limits import path

MASS, VISCOUS, NOISE, INTERVAL = 2.0, 3.0, 0.01, 0.02
QUICK = {"limit": 4.0, "seconds": 4.0, "interval": INTERVAL, "noise": {"v": NOISE}, "rounds": 6}


@pytest.fixture(scope="module")
def linear():
    """An axis without friction: M v' = u - Fv v."""
    table = Axis().with_values(M=MASS, Fv=VISCOUS, Fc=0.0, offset=0.0).parameters.with_free("M", "Fv")
    return Axis(parameters=table)


@pytest.fixture(scope="module")
def sticking():
    return Axis().with_values(M=1.0, Fv=2.0, Fc=0.5, offset=0.1)


@pytest.fixture(scope="module")
def designed(sticking):
    return design_experiment(sticking, **QUICK, radius=0.5, speeds={"v": 1.2}, seed=3)


def sensitivities(u):
    """dv/dM and dv/dFv [T, 2] of the linear axis, by SciPy's exact zero-order hold.

    v = G u with G = 1 / (M s + Fv), so dv/dM = -s G² u and dv/dFv = -G² u.
    """
    found = []
    for numerator in ([-1.0, 0.0], [-1.0]):
        denominator = np.polymul([MASS, VISCOUS], [MASS, VISCOUS])
        b, a, _ = cont2discrete((numerator, denominator), INTERVAL, method="zoh")
        found.append(lfilter(np.ravel(b), a, u))
    return np.stack(found, axis=-1)


def test_information_of_a_linear_axis_is_the_exact_one(linear):
    rng = np.random.default_rng(5)
    inputs = np.stack([rng.uniform(-3, 3, 200), np.repeat(rng.uniform(-3, 3, 10), 20)])[..., None]
    found = Laboratory(linear, {"v": NOISE}, 200, INTERVAL, 0.1, 0).run(inputs).information
    for u, information in zip(inputs[..., 0], found, strict=True):
        scaled = sensitivities(u) * [MASS, VISCOUS] / NOISE
        np.testing.assert_allclose(information, scaled.T @ scaled, rtol=1e-6)
        np.testing.assert_allclose(
            std_errors(information), np.sqrt(np.diag(np.linalg.inv(scaled.T @ scaled))), rtol=1e-6
        )


def test_expected_errors_are_those_that_identifiability_expects(sticking, designed):
    found = identifiability(sticking, designed.logs, noise={"v": NOISE, "q": 1e9})
    assert designed.std_errors.keys() == found.std_errors.keys()
    for name, error in designed.std_errors.items():
        assert error == pytest.approx(found.std_errors[name], rel=1e-3), name


def test_the_design_beats_the_prbs_of_the_same_energy_and_the_search_its_start(sticking, designed):
    run, prbs = designed.runs[0], designed.reference_runs[0]
    assert prbs.energy == pytest.approx(run.energy, rel=1e-9) and prbs.time[-1] == run.time[-1]
    assert len(np.unique(np.abs(prbs.inputs).round(9))) == 1
    assert designed.gain < 0.8
    assert designed.gain == pytest.approx(np.exp(np.mean(np.log(list(designed.ratios.values())))))
    start = design_experiment(sticking, **QUICK | {"rounds": 0}, radius=0.5, speeds={"v": 1.2}, seed=3)
    laboratory = Laboratory(sticking, {"v": NOISE}, 200, INTERVAL, 0.1, 3)
    better, first = criterion(laboratory.run(np.stack([run.inputs, start.runs[0].inputs])).information)
    assert better > first + 0.5


def test_limits_hold_on_the_exact_trajectory(designed, axis_law):
    run = designed.runs[0]
    assert np.max(np.abs(run.inputs)) <= 4.0
    speed, position = axis_law(run.inputs[:, 0], INTERVAL, M=1.0, Fv=2.0, Fc=0.5, offset=0.1)
    np.testing.assert_allclose(run.outputs[:, 0], speed, atol=1e-3)
    np.testing.assert_allclose(run.path[:, 0], position, atol=2e-3)
    assert np.max(np.abs(speed)) <= 1.2 and np.max(np.abs(position)) <= 0.5
    # The limits matter: without them the design drives farther.
    free = design_experiment(Axis().with_values(M=1.0, Fv=2.0, Fc=0.5, offset=0.1), **QUICK, seed=3)
    assert np.ptp(free.runs[0].path[:, 0]) > 1.0
    assert any("radius" in words or "u is at its limit" in words for words in run.limited_by)


@pytest.mark.parametrize("unit", [1e-3, 1e3])
def test_nothing_hangs_on_the_unit_of_time(sticking, unit):
    """Without a length given, an experiment takes it from the robot: the same samples, whatever its times are counted in."""
    si = design_experiment(sticking, limit=4.0, noise={"v": NOISE}, rounds=0)
    other = Axis().with_values(M=1.0 / unit**2, Fv=2.0 / unit, Fc=0.5, offset=0.1)
    found = design_experiment(other, limit=4.0, noise={"v": NOISE * unit}, rounds=0)
    assert found.runs[0].time[-1] * unit == pytest.approx(si.runs[0].time[-1], rel=1e-9)
    np.testing.assert_allclose(found.runs[0].inputs, si.runs[0].inputs, atol=1e-9)
    for name, factor in {"M": unit**2, "Fv": unit, "Fc": 1.0}.items():
        assert found.std_errors[name] * factor == pytest.approx(si.std_errors[name], rel=1e-4), name


def test_a_seed_gives_one_design(sticking, designed):
    again = design_experiment(sticking, **QUICK, radius=0.5, speeds={"v": 1.2}, seed=3)
    assert np.array_equal(again.runs[0].inputs, designed.runs[0].inputs) and again.std_errors == designed.std_errors
    other = design_experiment(sticking, **QUICK, radius=0.5, speeds={"v": 1.2}, seed=4)
    assert not np.array_equal(other.runs[0].inputs, designed.runs[0].inputs)


def test_a_second_experiment_adds_what_the_first_left_open(sticking):
    two = design_experiment(sticking, **QUICK | {"rounds": 2}, experiments=2)
    one = design_experiment(sticking, **QUICK | {"rounds": 2})
    assert len(two.runs) == 2 and np.array_equal(two.runs[0].inputs, one.runs[0].inputs)
    laboratory = Laboratory(sticking, {"v": NOISE}, 200, INTERVAL, 0.1, 0)
    both = laboratory.run(np.stack([run.inputs for run in two.runs])).information
    np.testing.assert_allclose(list(two.std_errors.values()), std_errors(both.sum(axis=0)) * laboratory.magnitude)
    assert all(two.std_errors[name] < one.std_errors[name] for name in one.values)


def test_what_is_known_from_logs_or_their_fit_counts(sticking, axis_log):
    u = np.repeat([0.0, 3.0, -2.0, 1.0, -3.0, 0.0], 40)
    logs = LogSet([axis_log("so far", u, NOISE, 7, INTERVAL, position=False, M=1.0, Fv=2.0, Fc=0.5, offset=0.1)])
    fit = output_error(sticking, logs)
    magnitude = np.array([1.0, 2.0, 0.5, 1.0])
    expected = [fit[name].std_error for name in fit.free_names]
    for already in (fit, logs):
        found = std_errors(known(sticking, already, {"v": NOISE}, magnitude)) * magnitude
        np.testing.assert_allclose(found, expected, rtol=0.15)  # noise estimated, parameters as fitted or as given
    after = design_experiment(sticking, **QUICK | {"rounds": 0, "noise": None}, already=fit)
    assert all(after.std_errors[name] < after.before[name] for name in after.values)
    assert after.values == {name: fit[name].value for name in fit.free_names}
    assert after.doubt == ""
    # A table's start values are no robot's: who designs for them, with logs at hand, is told.
    other = design_experiment(sticking.with_values(M=0.1), **QUICK | {"rounds": 0, "noise": None}, already=logs)
    assert "leaves" in other.sentence and "fit it" in other.sentence
    prior = sticking.change("M", prior=(1.0, 0.02))
    assert known(prior, None, {}, magnitude)[0, 0] == pytest.approx(2500.0)


def test_noise_that_is_related_from_sample_to_sample_tells_less(sticking, axis_log):
    """Beside signals as slow as these by its long-run variance, (1 + r) / (1 - r) of its own."""
    u = np.repeat([0.0, 3.0, -2.0, 1.0, -3.0, 0.0], 120)
    clean = axis_log("so far", u, 1e-9, 7, INTERVAL, position=False, M=1.0, Fv=2.0, Fc=0.5, offset=0.1)
    errors = {}
    for r in (0.0, 0.9):
        noise = lfilter([np.sqrt(1.0 - r**2)], [1.0, -r], np.random.default_rng(0).normal(size=(len(u), 1)), axis=0)
        log = Log.from_arrays("so far", clean.time, clean.inputs, clean.outputs + NOISE * noise, sticking)
        found = design_experiment(sticking, **QUICK | {"rounds": 0, "noise": None}, already=LogSet([log]))
        errors[r] = np.array(list(found.std_errors.values()))
        assert ("related from sample to sample" in found.sentence) == (r > 0) and "fit it" not in found.sentence
    np.testing.assert_allclose(errors[0.9] / errors[0.0], np.sqrt(1.9 / 0.1), rtol=0.35)


def test_a_saved_design_is_a_log_to_drive(designed, sticking, tmp_path):
    (file,) = designed.save(tmp_path / "next.csv")
    table = pd.read_csv(file)
    assert list(table) == ["t", "u"]
    np.testing.assert_allclose(table["u"], designed.runs[0].inputs[:, 0], atol=1e-5)
    designed.save(tmp_path / "expected.csv", expected=True)
    logs = read_logs(tmp_path / "expected.csv", "axis")
    assert logs[0].sampling_interval == pytest.approx(INTERVAL)
    (simulated,) = simulate(sticking, logs)
    np.testing.assert_allclose(simulated, designed.log.outputs, atol=1e-4)


def test_it_says_what_it_is_worth(designed):
    text = repr(designed)
    assert text.startswith("Drive the axis") and designed.sentence in text and "PRBS" in text
    page = unescape(designed._repr_html_())
    assert "<table>" in page and designed.sentence in page and designed.runs[0].limited_by[0] in page


def test_paths_of_circles():
    """A robot at 1 m/s and 1 rad/s drives a circle of 1 m radius, the Pioneer from +y to the left, the omni from +x."""
    turns = np.linspace(0, np.pi, 2001)
    ones = np.ones_like(turns)
    pioneer = path(Pioneer(), np.stack([ones, ones], -1), turns[1])
    np.testing.assert_allclose(pioneer, np.stack([np.cos(turns) - 1, np.sin(turns)], -1), atol=1e-6)
    zero = 0 * ones
    omni = path(Omni(), np.stack([ones, zero, ones, *[zero] * 4], -1), turns[1])
    np.testing.assert_allclose(omni, np.stack([np.sin(turns), 1 - np.cos(turns)], -1), atol=1e-6)
    np.testing.assert_allclose(path(Axis(), np.stack([ones, zero], -1), turns[1])[-1], [np.pi, 0])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"limit": 0.0}, "finite number above zero"),
        ({"limit": 0.01}, "raise limit"),
        ({"limit": [1.0, 2.0]}, "one for each of \\['u'\\]"),
        ({"radius": 1e-4}, "radius of 0.0001 m .* raise it, or shorten"),
        ({"speeds": {"V": 1.0}}, "use some of v, q"),
        ({"rectangle": (2.0, 2.0)}, "give radius"),
        ({"noise": None}, "give noise ="),
        ({"noise": {"v": -1.0}}, "standard deviations above zero"),
        ({"seconds": 0.1}, "at least 20 sampling intervals"),
        ({"experiments": 0}, "at least one experiment"),
    ],
)
def test_what_cannot_be_designed_says_what_to_change(sticking, change, words):
    with pytest.raises(DesignError, match=words):
        design_experiment(sticking, **QUICK | {"rounds": 0} | change)


def test_inputs_on_the_verge_of_breaking_loose_are_not_believed(sticking):
    """0.62 N just overcomes a friction of 0.5 and an offset of 0.1 N; with 10 % more friction the axis stays at rest."""
    laboratory = Laboratory(sticking, {"v": NOISE}, 200, INTERVAL, 0.1, 0)
    inputs = np.stack([np.full((200, 1), 3.0), np.full((200, 1), 0.62)])
    own, up, down = (laboratory.run(inputs, which) for which in range(3))
    calm, sharp = laboratory.bend(own, up, down)
    assert calm < 0.2 < sharp


def near(**change):
    """The experiment of an axis that is to stay within 0.5 m, though it may be driven by 4 N."""
    axis = Axis().with_values(M=1.0, Fv=1.0, Fc=0.1, offset=0.0)
    given = {"limit": 4.0, "noise": {"v": 0.01}, "seconds": 10.0, "interval": 0.02, "radius": 0.5, "rounds": 0}
    return design_experiment(axis, **given | change)


def test_where_large_inputs_go_too_far_smaller_and_quicker_ones_are_looked_at():
    found = near(limit=8.0, doubt=0.05)
    (run,) = found.runs
    assert np.abs(run.path).max() < 0.5 and np.abs(run.inputs).max() < 0.15 * 8.0 + 1e-9
    # Those that keep to it leap from rest to motion with every change of the friction: not the radius alone is in the way.
    with pytest.raises(DesignError, match="keeps to the radius of 0.5 m leaps .* lower doubt"):
        near()
