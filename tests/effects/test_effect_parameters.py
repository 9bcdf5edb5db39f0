"""jaxid/effects/effect_parameters.py: sizes at which an effect acts are numbers of the model.

What is compiled for a model serves every model that differs from it in numbers alone, in this process and in later ones; the
orders of magnitude `scales` are not among what tells models apart.
"""

from dataclasses import replace

import numpy as np
import pytest

from jaxid import Axis, DifferentialDrive, Log, LogSet, Omni, Pioneer, simulate
from jaxid.effects import effect_by_id, laws_of
from jaxid.effects.catalogue import ALL
from jaxid.effects.effect_parameters import per_speed

ROBOTS = (Pioneer(), Omni(), Axis(), DifferentialDrive())
LAWS = [
    pytest.param(robot, law, id=f"{robot.name}-{law.id}-{law.law}")
    for robot in ROBOTS
    for effect in ALL
    for law in laws_of(robot, effect.id)
]


def of_size(robot, times):
    """The same robot, of which its logs say that it is so many times as large, fast and slowly sampled."""
    of = robot.scales
    larger = {name: times * value for name, value in vars(of).items() if isinstance(value, float)}
    outputs = {name: times * of.output(name) for name in robot.channels.measured}
    return replace(robot, scales=replace(of, **larger, outputs=outputs))


@pytest.mark.parametrize(("robot", "law"), LAWS)
def test_stages_take_no_size_from_the_scales(robot, law):
    model = robot + law
    names = model.parameters
    typical = {k: names[k].value or names[k].typical or 1.0 for k in law.parameters(robot)}
    model = model.with_values(**typical)
    rng, found = np.random.default_rng(4), []
    state = dict(zip(model.states, 0.05 * rng.normal(size=len(model.states)), strict=True))
    inputs = tuple(5.0 + rng.normal(size=len(model.channels.inputs)))
    for one in (model, of_size(model, 1000.0), of_size(model, 0.001)):
        p = model.parameters.numbers
        dry = (0.0,) * len(one.rubbing(state, p))
        found.append([*one.rates(state, inputs, dry, p).values(), *one.observe(state, inputs, p)])
    np.testing.assert_allclose(found[1], found[0], rtol=1e-4)
    np.testing.assert_allclose(found[2], found[0], rtol=1e-4)


class OfThisTest(DifferentialDrive):
    """A robot that nothing has been compiled for."""


def test_a_robot_is_simulated_alike_whatever_robot_came_before():
    """A moment of 2 N m against dry friction of 1 N m turns 1 kg m² faster by 1 rad/s in every second; of a robot that is
    faster by far, and was compiled before, the wheels would hardly scrub at such yaw rates yet."""
    time = np.linspace(0.0, 2.0, 101)
    u, nothing = np.column_stack([np.full(101, 2.0), np.full(101, -2.0)]), np.zeros((101, 2))
    for size in (500.0, 0.5):
        robot = of_size(OfThisTest(), size)
        model = robot + effect_by_id(robot, "turning_friction", "coulomb_and_viscous")
        known = {"M": 1.0, "J": 1.0, "b": 0.5, "Fv": 0.0, "Fc": 0.0, "turning_friction.coulomb": 1.0}
        model = model.with_values(**known)
        (found,) = simulate(model, LogSet([Log.from_arrays("turn", time, u, nothing, model)]))
    np.testing.assert_allclose(found[:, 1], time, atol=0.05)


def test_units_of_forces_over_speeds_hold_the_speeds_own_unit():
    assert per_speed("N", "m/s") == "N s/m" and per_speed("N", "mm/s", 2) == "N s^2/mm^2"
    assert per_speed("N m", "deg/s") == "N m s/deg" and per_speed("mN m", "rpm", 2) == "mN m/rpm^2"
