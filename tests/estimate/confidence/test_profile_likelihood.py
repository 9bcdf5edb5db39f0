"""jaxid/estimate/profile_likelihood.py against SciPy's minimiser, and for what data leaves open."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from jaxid import Axis, Integrator, LogSet, ParameterError, Profiles, output_error, profile_likelihood, simulate
from jaxid.estimate.confidence.profile_likelihood import Profile, _Side
from jaxid.estimate.confidence.white_noise import not_white

TRUE = {"M": 1.0, "Fv": 2.0, "Fc": 0.5}
ROBOT = Axis().change("offset", free=False).with_values(**TRUE)
STEP = Integrator(2)


@pytest.fixture(scope="module")
def logs(axis_log):
    inputs = np.repeat([1.5, -1.0, 0.8, 2.0], 40)
    return LogSet([axis_log("a", inputs, noise=0.05, seed=4, position=False, **TRUE)])


@pytest.fixture(scope="module")
def fit(logs):
    return output_error(ROBOT, logs, integrator=STEP)


def test_interval_ends_are_where_scipys_best_fit_is_worse_by_3_84(fit, logs):
    profiles = profile_likelihood(fit, logs, ["M", "Fc"], integrator=STEP)
    measured, sigma = logs[0].output("v"), fit.noise["v"]

    def residual(values):
        model = ROBOT.with_values(**values)
        return (simulate(model, logs, integrator=STEP)[0][:, 0] - measured) / sigma

    def rise(held, value):
        others = [n for n in TRUE if n != held]
        start = [fit[n].value for n in others]
        found = least_squares(
            lambda x: residual({held: value, **dict(zip(others, np.abs(x), strict=True))}), start, x_scale=start
        )
        return 2 * found.cost - float(np.sum(residual({n: fit[n].value for n in TRUE}) ** 2))

    for name in ("M", "Fc"):
        profile = profiles[name]
        assert profile.open_ends == () and profile.ci95[0] < profile.value < profile.ci95[1]
        assert profile.value == pytest.approx(fit[name].value, abs=0.02 * fit[name].std_error)
        for end in profile.ci95:
            assert rise(name, end) == pytest.approx(3.84, abs=0.15)
        assert np.all(np.diff(profile.values) > 0) and profile.rise.min() > -0.01
        assert name in profile.sentence
        shown = f"{profile.ci95[0]:.5g} to {profile.ci95[1]:.5g}"
        assert shown in repr(profiles) and f">{shown}</td>" in profiles._repr_html_()
    assert repr(profiles).startswith("Profile likelihood: 2 of 2 intervals have both ends.")


def test_intervals_for_white_noise_say_so_where_the_residual_is_not(fit):
    assert not_white(fit) == ""
    poor = replace(fit, judgement=replace(fit.judgement, verdict="poor"))
    assert "The fit is poor" in not_white(poor) and "too narrow" in repr(Profiles({}, not_white(poor)))
    assert "coloured" in not_white(replace(fit, standard_errors="robust"))


def test_what_the_data_leaves_open_has_an_open_interval(axis_log):
    """Without a gain of its own force, mass, friction and gain only enter as ratios."""
    inputs = np.repeat([1.5, -1.0, 0.8, 2.0], 40)
    logs = LogSet([axis_log("a", inputs, noise=0.05, seed=4, position=False, **TRUE)])
    robot = ROBOT.change("gain", free=True)
    fit = output_error(robot, logs, integrator=STEP)
    profiles = profile_likelihood(fit, logs, ["M"], integrator=STEP)
    profile = profiles["M"]
    assert "without: M." in profiles._repr_html_()
    assert "above" in profile.open_ends and "does not end it" in profile.sentence


def test_a_search_that_fails_far_out_makes_no_end(axis_log):
    """All of mass, friction and gain times the same number move alike: each is free as far as the bounds of the others let
    it be. A search for the others that begins far from there ends in a minimum of its own, or nowhere."""
    inputs = np.repeat([3.0, -2.0, 1.6, 4.0, -4.0, 2.0], 30)
    logs = LogSet([axis_log("a", inputs, noise=0.01, seed=4, position=False, **TRUE)])
    robot = ROBOT.change("gain", free=True)
    for name in (*TRUE, "gain"):
        robot = robot.change(name, lower=0.01)
    fit = output_error(robot, logs, integrator=STEP)
    profiles = profile_likelihood(fit, logs, integrator=STEP)
    least = max(0.01 / fit[name].value for name in fit.free_names)
    for name, profile in profiles.profiles.items():
        assert profile.ci95[0] <= 1.001 * least * profile.value and profile.ci95[1] == np.inf
        assert "above" in profile.open_ends and profile.rise[-1] < 0.01 and profile.values[-1] > 50 * profile.value, (
            name
        )


def test_where_no_search_converges_the_end_is_not_found():
    rises = {1.0: 0.0, 2.0: 0.5}
    side = _Side.of(rises, {2.0: 1.0, 4.0: 2.0, 3.0: 2.0}, 1.0, 1.0, 10.0)
    assert side.end is None and not side.open and side.next(3.0) == [2.25, 2.5, 3.0]
    # A point above the level is no end before it was looked at from close by; one below it, further out, is proof.
    high = _Side.of({**rises, 3.0: 400.0}, {2.0: 1.0, 3.0: 1.0}, 1.0, 1.0, 10.0)
    assert high.end is None and high.next(3.0)[-1] == 3.0
    assert _Side.of({**rises, 3.0: 400.0}, {2.0: 1.0, 3.0: 2.97}, 1.0, 1.0, 10.0).end == 3.0
    beyond = _Side.of({**rises, 3.0: 400.0, 4.0: 1.0}, dict.fromkeys((2.0, 3.0, 4.0), 1.0), 1.0, 1.0, 10.0)
    assert beyond.near == (4.0, 1.0) and beyond.end is None and not beyond.open
    profile = Profile("M", "kg", 1.0, np.array([1.0]), np.array([0.0]), (0.0, np.inf), (0, 2), ("below",), ("above",))
    assert "does not end it below; its end above was not found" in profile.sentence
    text = repr(Profiles({"M": profile}))
    assert "0 of 1 intervals have both ends; without: M; not found: M." in text and "end not found" in text


def test_a_parameter_that_was_not_estimated_is_an_error(fit, logs):
    with pytest.raises(ParameterError, match="did not estimate 'offset'; its free parameters are M, Fv, Fc"):
        profile_likelihood(fit, logs, ["offset"])


def test_a_prior_holds_the_parameter_that_it_is_of_where_no_log_does(logs):
    """Of mass, friction and gain the logs know all but one factor, which the mass's prior alone says."""
    robot = ROBOT.change("gain", free=True).change("M", prior=(TRUE["M"], 0.05))
    found = output_error(robot, logs, integrator=STEP)
    profiles = profile_likelihood(found, logs, ["M", "gain"], integrator=STEP)
    for name in ("M", "gain"):
        assert not profiles[name].open_ends
        np.testing.assert_allclose(profiles[name].ci95, profiles[name].wald, rtol=0.05)
