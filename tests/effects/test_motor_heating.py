"""A winding whose resistance rises less and less: the formula where it does not level off, and standard errors where it may."""

import numpy as np
import pytest

from jaxid import Log, LogSet, Pioneer, simulate
from jaxid.effects import effect_by_id
from jaxid.explanation.search.denser import with_freer_form

COEFFICIENT = "motor_heating.coefficient"


@pytest.fixture(scope="module")
def driven():
    random = np.random.default_rng(4)
    volts = np.repeat(random.uniform(-11, 11, (40, 2)), 20, axis=0)
    return LogSet([Log.from_arrays("one", 0.02 * np.arange(800), volts, np.zeros((800, 2)), Pioneer())])


def test_what_does_not_level_off_is_the_formula(driven):
    robot = (Pioneer() + effect_by_id(Pioneer(), "motor_heating")).with_values(**{COEFFICIENT: 1e-3})
    freer = with_freer_form(robot, robot.effects[-1])
    (effect,) = freer.effects
    assert effect.law == "levelling_off" and effect.freer is None
    (plain,), (same,), (less,) = (
        simulate(each, driven) for each in (robot, freer, freer.with_values(**{"motor_heating.levelling": 2e-3}))
    )
    assert np.allclose(plain, same, atol=1e-12)
    (cold,) = simulate(Pioneer(), driven)
    # By the end it has risen by less, and the robot moves more like a cold one.
    assert 0.1 < np.linalg.norm((less - cold)[-200:]) / np.linalg.norm((plain - cold)[-200:]) < 0.9


@pytest.mark.parametrize("law", ["with_cooling", "torque_constant"])
def test_other_laws_have_no_such_form(law):
    assert effect_by_id(Pioneer(), "motor_heating", law).freer is None
