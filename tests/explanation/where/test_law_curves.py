"""Curves of named effects are those of the formulas, with the errors that the fit's covariance gives them."""

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest

from benchmarks.fingerprints.steered import CAR
from jaxid import Axis, Effect, Omni, Parameter
from jaxid.effects import catalogue, effect_by_id
from jaxid.explanation.where.law_curves import _chosen, _floor, law_curves
from jaxid.explanation.where.stage_sweeps import POINTS, sweeps
from jaxid.robots.signal_path import overrides

NO_FLOOR = np.zeros((0, 2))


def swept(robot, effect, floor=NO_FLOOR, largest=None, **values):
    """(sweep, parts, after, change) of `effect` on `robot`, its parameters at `values`."""
    whole = (robot + effect).with_values(**{effect.key(name): value for name, value in values.items()})
    found = []
    for group in sweeps(effect, whole, robot.scales, floor, largest or {}):
        for sweep, parts in _chosen(group, SimpleNamespace(robot=whole), robot):
            after = np.asarray(sweep.response(whole, whole.parameters.numbers))
            found.append((sweep, parts, after, after - np.asarray(sweep.response(robot, robot.parameters.numbers))))
    return found


@pytest.mark.slow
def test_the_curve_of_a_drag_is_its_formula_and_the_data_lies_on_it(explained):
    forces = explained.localisation.forces
    (curve,) = law_curves(["quadratic_drag"], explained.baseline, explained.final, explained.held_out, forces)[
        "quadratic_drag"
    ]
    v = curve.values
    assert len(v) == POINTS and (curve.quantity, curve.unit, curve.shared) == ("force", "N", 1)
    p = explained.final.robot.parameters.numbers
    drag = p["quadratic_drag.coefficient"] * v * np.abs(v)
    friction = p["Fc"] * np.sign(v) + p["Fv"] * v + p["offset"]
    np.testing.assert_allclose(curve.after, -drag - friction, atol=1e-9)
    np.testing.assert_allclose(curve.change, -drag, atol=1e-9)
    first = explained.baseline.robot.parameters.numbers
    np.testing.assert_allclose(curve.before, -first["Fc"] * np.sign(v) - first["Fv"] * v - first["offset"], atol=1e-9)
    # The standard deviation by the exact gradient.
    slopes = {"quadratic_drag.coefficient": v * np.abs(v), "Fc": np.sign(v), "Fv": v, "offset": np.ones_like(v)}
    gradient = np.stack([slopes.get(name, np.zeros_like(v)) for name in explained.final.free_names])
    exact = np.sqrt(np.einsum("in,ij,jn->n", gradient, np.nan_to_num(explained.final.covariance), gradient))
    np.testing.assert_allclose(curve.std, exact, rtol=1e-5)
    # Where it drives, what the measured motion asks for follows the last model, not the first.
    x, y = curve.samples
    fast = np.abs(x) > 0.5 * np.abs(x).max()
    after, before = (np.interp(x[fast], v, own) for own in (curve.after, curve.before))
    assert np.mean((y[fast] - after) ** 2) < 0.3 * np.mean((y[fast] - before) ** 2)


@pytest.mark.parametrize(
    ("identifier", "law", "values", "expected"),
    [
        ("actuator_dead_zone", "subtractive", {"threshold": 0.5}, lambda u: -np.clip(u, -0.5, 0.5)),
        ("voltage_saturation", "hard", {"inverse_limit": 0.25}, lambda u: np.clip(u, -4, 4) - u),
    ],
)
def test_a_command_s_map_is_drawn_over_the_command(double_precision, identifier, law, values, expected):
    ((sweep, parts, _, change),) = swept(Omni(), effect_by_id(Omni(), identifier, law), **values)
    assert (sweep.variable, sweep.of, parts) == ("command", "V", [0, 1, 2, 3])
    np.testing.assert_allclose(change, np.tile(expected(sweep.values), (4, 1)), atol=1e-12)


def test_a_steering_error_is_drawn_over_the_command_that_does_not_drive(double_precision):
    ((sweep, parts, after, change),) = swept(CAR, effect_by_id(CAR, "steering_error"), offset_steering=0.05)
    assert (sweep.variable, sweep.of, sweep.parts) == ("command", "rad", ("of steering",)) and parts == [0]
    np.testing.assert_allclose(change[0], 0.05, atol=1e-12)
    assert np.max(sweep.values) == pytest.approx(1.1 * CAR.scales.input_of("steering"))


def test_a_lag_is_drawn_as_the_response_to_a_step(double_precision):
    ((sweep, _, after, _),) = swept(Omni(), effect_by_id(Omni(), "motor_lag", "first_order"), time_constant=0.1)
    assert sweep.family == "step"
    expected = 0.5 * Omni().scales.input * (1 - np.exp(-sweep.values / 0.1))
    np.testing.assert_allclose(after[0], expected, atol=0.01 * Omni().scales.input)


def test_a_slope_is_drawn_over_the_heading_and_a_bias_over_time(double_precision):
    found = swept(Omni(), effect_by_id(Omni(), "ground_slope", "plane"), slope_x=0.01)
    assert {sweep.variable for sweep, *_ in found} == {"heading"}
    sweep, parts, _, change = found[0]
    pull = 35.0 * 9.81 * 0.01
    assert parts == [0, 1]
    np.testing.assert_allclose(change[:2], [pull * np.cos(sweep.values), -pull * np.sin(sweep.values)], atol=1e-9)
    ((sweep, parts, after, _),) = swept(Omni(), effect_by_id(Omni(), "sensor_bias", "constant"), bias_Vn=0.02)
    assert (sweep.variable, parts) == ("time", [1])
    np.testing.assert_allclose(after[1], 0.02)


def test_friction_beyond_a_line_is_a_map_of_the_floor(double_precision):
    x, y = np.meshgrid(np.linspace(-2, 2, 30), np.linspace(-2, 2, 30))
    floor = np.stack([x.ravel(), y.ravel()], axis=1)
    effect = effect_by_id(Omni(), "surface_change", "line")
    ((sweep, _, _, change),) = swept(Omni(), effect, floor, coulomb=0.5, angle=0.0, offset=0.4)
    assert sweep.kind == "place"
    far = np.abs(floor[:, 0] - 0.4) > 0.3
    expected = np.where(floor[:, 0] > 0.4, 0.5 * 29.45, 0.0)
    np.testing.assert_allclose(change[0][far], expected[far], atol=0.1)


@dataclass(frozen=True)
class StickyAtHighSpeed(Effect):
    """A user's own: friction that grows beyond half a metre a second."""

    id: ClassVar[str] = "sticky_at_high_speed"
    where: ClassVar[str] = "drivetrain"
    formula: ClassVar[str] = "C' = C + more where |v| > 0.5"

    def parameters(self, robot):
        return {self.key("more"): Parameter(0.0, "N", free=True)}

    def dry(self, levels, speeds, state, p):
        more = p[self.key("more")] * (abs(speeds[0]) > 0.5)
        return tuple((back + more, ahead + more) for back, ahead in levels)


def test_a_user_s_own_effect_has_its_curve(double_precision):
    ((sweep, _, _, change),) = swept(Axis(), StickyAtHighSpeed(), more=0.3)
    v = sweep.values
    assert (sweep.quantity, sweep.variable) == ("friction", "speed")
    np.testing.assert_allclose(change[0], 0.3 * np.sign(v) * (np.abs(v) > 0.5), atol=1e-12)


def test_every_mechanism_that_acts_at_a_stage_has_a_curve(double_precision):
    """All but those that are constants of the robot itself, or change them."""
    robot = Omni()
    path = np.linspace(-1.0, 1.0, 30)
    floor = np.stack([c.ravel() for c in np.meshgrid(path, path)], axis=1)
    for effect in catalogue(robot):
        whole = robot + effect
        typical = {n.split(".")[1]: q.typical for n, q in effect.parameters(robot).items() if q.value == 0.0}
        if not typical or overrides(type(effect), "numbers"):
            continue
        heat = dict.fromkeys(effect.states_on(whole), 100.0)
        assert swept(robot, effect, floor, heat, **typical), effect.id


def test_an_effect_that_cannot_be_asked_has_no_curve(explained, monkeypatch):
    def refuse(*_):
        raise TypeError("not in a row")

    monkeypatch.setattr("jaxid.explanation.where.law_curves._curves", refuse)
    found = law_curves(["quadratic_drag"], explained.baseline, explained.final, explained.held_out)
    assert found == {"quadratic_drag": ()}
    nothing = replace(explained, effects=())
    assert law_curves([], nothing.baseline, nothing.final, nothing.held_out) == {}


def test_a_curve_of_what_is_not_identified_has_no_band(explained):
    place = explained.final.free_names.index("quadratic_drag.coefficient")
    unknown = np.array(explained.final.covariance)
    unknown[place], unknown[:, place] = np.nan, np.nan
    final = replace(explained.final, covariance=unknown)
    ((curve,),) = law_curves(["quadratic_drag"], explained.baseline, final, explained.held_out).values()
    assert np.isnan(curve.std).all() and np.isfinite(curve.after).all()


def test_a_robot_that_drove_along_a_line_alone_has_a_floor_to_draw():
    """A surface that changes is a map; of logs that only go straight it was one row, which nothing could draw."""
    path = np.column_stack([np.linspace(0.0, 4.0, 50), np.zeros(50)])
    for shown in (path, path[:, ::-1], 0.0 * path):
        floor, driven = _floor([SimpleNamespace(path=shown)])
        x, y = (np.unique(column) for column in floor.T)
        assert len(x) * len(y) == len(floor) and min(np.ptp(x), np.ptp(y)) > 0.1
        assert np.array_equal(driven, shown)
