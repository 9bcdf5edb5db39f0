"""Curves of several mechanisms that are one function on a robot."""

import numpy as np
import pytest

from jaxid import Axis, Log, LogSet, Omni, Pioneer
from jaxid.effects import effect_by_id
from jaxid.explanation.left.heldout import HeldOut
from jaxid.explanation.refits.refit import Trial
from jaxid.explanation.search.denser import with_curves_apart
from jaxid.explanation.search.from_the_back import not_present
from jaxid.explanation.search.same_curves import curves_that_are

STATE = HeldOut(2.0, {}, (np.ones((10, 1)),), {}, 0.0)
PROMISED = ("quadratic_drag", "sublinear_viscous_friction", "turning_friction", "traction_limit")


def answer(robot, identifier, heights, apart=False):
    """What a curve with these heights is the same as, on logs whose speeds and inputs have nothing to do with each other."""
    model = robot + effect_by_id(robot, identifier, "shape")
    model = with_curves_apart(model, identifier) if apart else model
    model = model.with_values(**{f"{identifier}.{name}": value for name, value in heights.items()})
    rng, outputs, inputs = np.random.default_rng(0), len(robot.channels.outputs), len(robot.channels.inputs)
    columns = rng.uniform(-10.0, 10.0, (400, inputs)), rng.uniform(-1.0, 1.0, (400, outputs))
    logs = LogSet([Log.from_arrays("one", 0.02 * np.arange(400), *columns, robot)])
    before = Trial("", robot, 4.0, 5, STATE, lambda: STATE, {})
    return set(curves_that_are(before, Trial(identifier, model, 1.0, 9, STATE, lambda: STATE, {}), PROMISED, logs))


@pytest.mark.parametrize(
    ("identifier", "other"),
    [("quadratic_drag", "sublinear_viscous_friction"), ("sublinear_viscous_friction", "quadratic_drag")],
)
def test_on_one_axis_drag_and_a_bent_friction_are_one_curve(identifier, other):
    heights = {"at_1": 6.7, "at_2": 12.0, "at_3": 15.3, "at_4": 16.7}
    assert answer(Axis(), identifier, heights) == {other}


def test_on_wheels_they_are_two():
    assert answer(Pioneer(), "quadratic_drag", {"at_1": 0.3, "at_2": 1.0, "at_3": 2.2, "at_4": 4.0}) == set()


def test_on_axes_that_are_the_bodys_they_are_one_where_each_has_its_own():
    heights = {"at_1": 3.0, "at_2": 15.0, "at_3": 43.0, "at_4": 110.0}
    forward = {f"{name}_V": value for name, value in heights.items()}
    assert answer(Omni(), "quadratic_drag", forward, apart=True) == {"sublinear_viscous_friction"}
    assert answer(Omni(), "quadratic_drag", heights) == set()


@pytest.mark.parametrize("robot", [Axis(), Pioneer()], ids=["axis", "pioneer"])
def test_no_curve_is_tried_that_the_model_has_by_another_name(robot):
    rng, sizes = np.random.default_rng(0), (len(robot.channels.inputs), len(robot.channels.outputs))
    columns = (rng.uniform(-10.0, 10.0, (400, n)) / (10.0 if k else 1.0) for k, n in enumerate(sizes))
    logs = LogSet([Log.from_arrays("one", 0.02 * np.arange(400), *columns, robot)])
    model = robot + effect_by_id(robot, "sublinear_viscous_friction", "shape")
    curves = {law.id for law in not_present(model, (), logs) if law.law == "shape"}
    every = {law.id for law in not_present(model, ()) if law.law == "shape"}
    gone = (
        {"asymmetric_viscous_friction", "quadratic_drag"} if robot.name == "axis" else {"asymmetric_viscous_friction"}
    )
    assert gone <= every - curves <= gone | {"stribeck_friction", "asymmetric_friction"}
    # A formula stands beside the curve, which cannot be all that it is.
    laws = {(law.id, law.law) for law in not_present(model, (), logs)}
    assert ("asymmetric_viscous_friction", "all_axes") in laws
    assert {law.id for law in not_present(robot, (), logs)} == {law.id for law in not_present(robot, ())}
