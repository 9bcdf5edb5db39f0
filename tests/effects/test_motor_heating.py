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


@pytest.mark.parametrize("law", ["with_cooling", "torque_constant", "torque_constant_with_cooling"])
def test_other_laws_have_no_such_form(law):
    assert effect_by_id(Pioneer(), "motor_heating", law).freer is None


@pytest.mark.slow
def test_magnets_that_cool_are_weaker_by_the_heat_that_is_left(driven):
    """The heat of a steady current is P T (1 - exp(-t / T)); without cooling worth the name the law is that of the magnets."""
    robot = (Pioneer() + effect_by_id(Pioneer(), "motor_heating", "torque_constant_with_cooling")).with_values(
        **{COEFFICIENT: 1e-3, "motor_heating.time_constant": 5.0}
    )
    (effect,), p = robot.effects, robot.parameters.numbers
    heats, watts, T = effect.states_on(robot), p[robot.winding] * 3.0**2, 5.0
    seconds, heat = 1e-3 * np.arange(8000), 0.0
    for _ in seconds:
        heat += 1e-3 * effect.rates(dict.fromkeys(heats, heat), (3.0, 3.0), p, robot)[heats[0]]
    assert heat == pytest.approx(watts * T * (1.0 - np.exp(-8.0 / T)), rel=1e-3)
    torques = effect.torque((2.0, -1.0), dict.fromkeys(heats, heat), p, robot)
    np.testing.assert_allclose(torques, np.array([2.0, -1.0]) * (1.0 - 1e-3 * heat))

    magnets = Pioneer() + effect_by_id(Pioneer(), "motor_heating", "torque_constant")
    (cold,), (warm,), (never,), (plain,) = (
        simulate(each, driven)
        for each in (
            Pioneer(),
            robot,
            robot.with_values(**{"motor_heating.time_constant": 1e9}),
            magnets.with_values(**{COEFFICIENT: 1e-3}),
        )
    )
    np.testing.assert_allclose(never, plain, atol=1e-6)
    assert 0.05 < np.linalg.norm((warm - cold)[-200:]) / np.linalg.norm((plain - cold)[-200:]) < 0.95
