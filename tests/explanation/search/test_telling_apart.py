"""Which names the data cannot tell apart, on residuals made up for the purpose."""

from dataclasses import replace

import numpy as np
import pytest

from jaxid import Axis
from jaxid.effects import effect_by_id
from jaxid.explanation.left.heldout import HeldOut
from jaxid.explanation.refits.refit import Trial
from jaxid.explanation.search.telling_apart import differ, not_told_apart, simplest_first, supersets, told_apart


def trial(name: str, residual: np.ndarray) -> Trial:
    held_out = HeldOut(float(np.sqrt(np.mean(residual**2))), {"v": 1.0}, (residual[:, None],), {"v": 0.01}, 0.5)
    return Trial(
        name, Axis() + effect_by_id(Axis(), name), float(2 * np.sum(residual**2)), 5, held_out, lambda: held_out, {}
    )


@pytest.fixture
def residuals():
    """Noise, and the same with a wrong prediction on top: 0.07 times the noise, 6 standard errors of the likelihood."""
    noise = np.random.default_rng(4).standard_normal(20000)
    return noise, noise + 0.07 * np.sign(np.sin(np.arange(20000) / 40))


def test_delays_of_a_robot_that_starts_at_rest_are_one_model(residuals):
    right, other = residuals
    first, second = trial("input_delay", right), trial("sensor_delay", other)
    assert differ(first.held_out, second.held_out) == pytest.approx(0.07, rel=1e-3) and second.score - first.score > 100
    assert not_told_apart([first, second]) == ("sensor_delay",)


def test_other_names_are_told_apart_by_as_little(residuals):
    right, other = residuals
    assert not_told_apart([trial("motor_lag", right), trial("sensor_lag", other)]) == ()


def test_delays_that_differ_by_more_than_interpolation_are_two(residuals):
    right, other = residuals
    far = right + 3 * (other - right)
    assert not_told_apart([trial("input_delay", right), trial("sensor_delay", far)]) == ()


def test_delays_that_differ_by_little_of_what_a_delay_makes_are_one(residuals):
    """Where a delay moves a position by hundreds of an encoder's counts, interpolation is off by more than the noise."""
    right, other = residuals
    far = right + 3 * (other - right)
    trials = [trial("input_delay", right), trial("sensor_delay", far)]
    missing = np.sin(np.arange(20000) / 40)
    assert not_told_apart(trials, trial("motor_lag", right + 40 * missing)) == ("sensor_delay",)
    assert not_told_apart(trials, trial("motor_lag", right + 20 * missing)) == ()


def test_prescribed_angles_tell_no_delays_apart(residuals):
    """Angles from a late sensor are late, too: the model of a late sensor is held back by them, that of a late input not."""
    right, other = residuals
    far = right + 30 * (other - right)
    first, second = trial("input_delay", right), trial("sensor_delay", far)
    assert not_told_apart([first, second]) == ()
    prescribed = {"angles": (np.zeros((20000, 1)),)}
    assert not_told_apart([replace(own, **prescribed) for own in (first, second)]) == ("sensor_delay",)
    by_jitter = replace(second, robot=Axis() + effect_by_id(Axis(), "sensor_delay", "jittering"), **prescribed)
    assert not_told_apart([replace(first, **prescribed), by_jitter]) == ("sensor_delay",)
    lag = replace(trial("motor_lag", far), **prescribed)
    assert not_told_apart([replace(first, **prescribed), lag]) == ()


def test_equally_likely_names_are_one_set(residuals):
    right, _ = residuals
    first = trial("motor_lag", right)
    again = right + 0.02 * np.random.default_rng(5).standard_normal(right.size)
    assert not_told_apart([first, replace(trial("sensor_lag", again), squares=first.squares)]) == ("sensor_lag",)


def test_one_model_by_two_names_is_not_told_apart_by_rounding(residuals):
    """Differences of 1e-9 of the noise, all one way: many standard errors of next to nothing."""
    right, _ = residuals
    again = right * (1.0 + 1e-9)
    first, second = trial("sensor_lag", right), trial("sensor_delay", again)
    assert told_apart(first.fitted, second.fitted) > 50.0
    assert not_told_apart([first, second]) == ("sensor_delay",)
    # By a likelihood ratio that says something, of predictions that nobody could tell; and of such as one could.
    further = trial("sensor_delay", right * (1.0 + 1e-3))
    assert not_told_apart([first, further]) == ("sensor_delay",)
    assert not_told_apart([first, trial("sensor_delay", right * 1.06)]) == ()


def test_what_is_won_by_more_parameters_alone_is_no_evidence(residuals):
    """A curve's few more numbers follow the noise a little: as sure as many blocks are, and no more than their price."""
    right, _ = residuals
    worse = right + 0.06 * np.sign(right)
    many, few = trial("stribeck_friction", right), trial("quadratic_drag", worse)
    gained = float(np.sum(worse**2 - right**2))
    assert not_told_apart([many, few]) == () and told_apart(many.fitted, few.fitted) > 2.0
    count = round(gained / np.log(right.size))
    assert not_told_apart([replace(many, free=few.free + count), few]) == ("quadratic_drag",)


def test_a_formula_that_does_as_well_comes_before_a_curve_of_more_parameters_which_is_no_rival(residuals):
    noise, _ = residuals
    robot = Axis()
    curve, formula = (
        robot + effect_by_id(robot, *own) for own in (("stribeck_friction", "shape"), ("quadratic_drag",))
    )
    follows = replace(trial("stribeck_friction", noise), robot=curve, free=9)
    again = noise + 0.02 * np.random.default_rng(5).standard_normal(noise.size)
    plain = replace(trial("quadratic_drag", again), robot=formula, free=6)
    ranked = simplest_first([follows, plain])
    assert [t.id for t in ranked] == ["quadratic_drag", "stribeck_friction"]
    assert supersets(ranked) == {"stribeck_friction"}
    # Where the curve does better by more than chance, it is the answer, and no formula is kept from it.
    worse = replace(plain, fitted=trial("quadratic_drag", noise + 0.1 * np.sign(again)).fitted)
    assert simplest_first([follows, worse])[0] is follows and supersets([follows, worse]) == set()
