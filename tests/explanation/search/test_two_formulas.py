"""Friction that rises towards standstill and a drag at once, which one curve of the speed follows but for a little."""

from dataclasses import replace

import numpy as np
import pytest

from jaxid import Axis, Log, LogSet
from jaxid.effects import effect_by_id
from jaxid.explanation.refits.refit import continued, refit
from jaxid.explanation.search.steps import Step
from jaxid.explanation.search.two_formulas import by_two_formulas
from jaxid.simulation.scaled import scaled_to

M, FV, FC, RISE, SPEED, DRAG = 2.0, 1.0, 0.6, 0.8, 0.06, 3.0
DT, STEPS, NOISE = 0.02, 40, 0.003


def run(seed, drag=DRAG, rise=RISE):
    """Twenty seconds under steps of force, by small steps of Heun's rule, the axis held at rest by its dry friction."""
    rng = np.random.default_rng(seed)
    force = np.repeat(rng.uniform(-6.0, 6.0, 40), 25)
    h, v, seen = DT / STEPS, 0.0, []

    def rate(v, f, way):
        dry = FC + rise / (1.0 + (v / SPEED) ** 2)
        return (f - FV * v - drag * v * abs(v) - dry * way) / M

    for f in force:
        seen.append(v)
        for _ in range(STEPS):
            if v == 0.0 and abs(f) <= FC + rise:
                continue
            way = np.sign(v) or np.sign(f)
            first = rate(v, f, way)
            after = v + 0.5 * h * (first + rate(v + h * first, f, way))
            v = 0.0 if after * way < 0.0 else after
    shown = np.array(seen) + NOISE * rng.normal(size=len(seen))
    return Log.from_arrays(f"run {seed}", DT * np.arange(len(force)), force[:, None], shown[:, None], Axis())


def by_a_curve(logs, held_out):
    robot = scaled_to(Axis().with_values(M=M, Fv=FV, Fc=FC, offset=0.0), logs)
    noise = {"v": NOISE}

    def fitted(model):
        start = {name: model.parameters[name].value for name in model.parameters.free_names}
        return refit(model, [start], logs, held_out, noise, {})

    base = fitted(robot)
    curve = fitted(base.robot + effect_by_id(robot, "sublinear_viscous_friction", "shape"))
    curve = continued(curve, logs, held_out, noise)
    return [Step((curve,), (), (), base, curve, (curve,))], curve, base, logs, held_out, noise


def test_a_curve_that_leaves_something_is_two_formulas():
    logs, held_out = LogSet([run(k) for k in range(3)]), LogSet([run(9)])
    steps, current, *rest = by_a_curve(logs, held_out)
    assert not current.held_out.adequate
    found, after = by_two_formulas(steps, current, *rest, lambda message: None)
    assert {step.chosen.id for step in found} == {"stribeck_friction", "quadratic_drag"}
    assert len(found) == 2 and after.held_out.normalised_rms < 1.05 < current.held_out.normalised_rms
    numbers = after.robot.parameters.numbers
    assert numbers["stribeck_friction.amplitude"] == pytest.approx(RISE, rel=0.05)
    assert numbers["stribeck_friction.speed"] == pytest.approx(SPEED, rel=0.05)
    assert numbers["quadratic_drag.coefficient"] == pytest.approx(DRAG, rel=0.01)
    assert (numbers["Fv"], numbers["Fc"]) == pytest.approx((FV, FC), rel=0.02)


def test_what_one_formula_explains_gets_no_second():
    """A curve that has gone astray is no reason for two."""
    logs, held_out = LogSet([run(k, drag=0.0) for k in range(3)]), LogSet([run(9, drag=0.0)])
    steps, current, *rest = by_a_curve(logs, held_out)
    found, after = by_two_formulas(steps, current, *rest, lambda message: None)
    assert found == steps and after is current


def test_a_curve_that_leaves_nothing_stays():
    logs, held_out = LogSet([run(k) for k in range(2)]), LogSet([run(9)])
    steps, current, *rest = by_a_curve(logs, held_out)
    enough = replace(current, predicts=lambda: replace(current.held_out, unrelated=True))
    assert by_two_formulas(steps, enough, *rest, pytest.fail) == (steps, enough)
