"""Curves through more points: the same curve at first, what was held still held, and taken only where it tells more."""

from dataclasses import replace

import numpy as np
import pytest

from jaxid import Axis, Omni, Pioneer, float64
from jaxid.effects import effect_by_id
from jaxid.explanation.left.heldout import HeldOut
from jaxid.explanation.refits.refit import Trial
from jaxid.explanation.search.denser import (
    densest,
    may_reach_farther,
    with_curves_apart,
    with_denser_curve,
    with_farther_reach,
    with_further_terms,
)
from jaxid.model_file import read_model, write_model


@pytest.fixture
def robot():
    """A Pioneer whose gyro warms up: five heights over 25 s for each channel, one of them held."""
    found = Pioneer() + effect_by_id(Pioneer(), "quadratic_drag") + effect_by_id(Pioneer(), "sensor_bias", "shape")
    heights = {f"sensor_bias.at_{k}_eta2": value for k, value in enumerate((0.0, 0.05, -0.02, 0.04, 0.01), start=1)}
    return found.with_values(**heights, **{"sensor_bias.reach": 30.0}).change("sensor_bias.at_5_eta1", free=False)


def offsets(robot):
    time = np.linspace(0.0, 35.0, 701)
    numbers = robot.parameters.numbers
    effect = next(effect for effect in robot.effects if effect.id == "sensor_bias")
    return np.asarray(effect.measure(np.zeros((701, 2)), time, numbers, robot))


def test_the_denser_curve_is_the_same_curve_nearly_and_at_its_points_exactly(robot):
    dense = with_denser_curve(robot, "sensor_bias")
    assert len([n for n in dense.parameters if n.startswith("sensor_bias.at_")]) == 18
    assert dense.parameters["sensor_bias.at_3_eta2"].value == robot.parameters["sensor_bias.at_2_eta2"].value
    # Through the same points, with slopes of parabolas through nearer neighbours: what differs falls with their distance.
    assert np.abs(offsets(dense) - offsets(robot)).max() < 0.1 * np.abs(offsets(robot)).max()
    denser = with_denser_curve(dense, "sensor_bias")
    assert np.abs(offsets(denser) - offsets(dense)).max() < 0.5 * np.abs(offsets(dense) - offsets(robot)).max()
    assert dense.parameters["sensor_bias.reach"].value == 30.0
    held = {n for n, p in dense.parameters.items() if n.startswith("sensor_bias.at_") and not p.free}
    assert held == {"sensor_bias.at_9_eta1"}
    assert [effect.id for effect in dense.effects] == ["quadratic_drag", "sensor_bias"]


def test_a_denser_model_is_written_and_read(robot, tmp_path):
    dense = with_denser_curve(with_denser_curve(robot, "sensor_bias"), "sensor_bias")
    write_model(tmp_path / "model.toml", dense)
    again = read_model(tmp_path / "model.toml", Pioneer())
    assert again.effects == dense.effects
    assert np.array_equal(offsets(again), offsets(dense))


def trial(robot, residual, free):
    state = HeldOut(float(np.sqrt(np.mean(residual**2))), {"v": 1.0}, (residual[:, None],), {"v": 1.0}, 0.0)
    return Trial("sensor_bias", robot, float(np.sum(residual**2)), free, state, lambda: state, {})


def test_points_that_tell_nothing_are_not_added(robot):
    noise = np.random.default_rng(0).normal(size=5000)
    wave = np.sin(np.arange(5000) / 300)
    coarse = trial(robot, noise + 0.5 * wave, 10)
    better = densest(coarse, lambda model, like: trial(model, noise + 0.1 * wave, 18))
    assert len(next(e for e in better.robot.effects if e.id == "sensor_bias").places) == 9
    same = densest(coarse, lambda model, like: trial(model, noise + 0.499 * wave, 18))
    assert same is coarse
    done = replace(coarse, fitted=replace(coarse.fitted, p_white=0.5, normalised_rms=1.0))
    assert densest(done, lambda model, like: pytest.fail("nothing is left to follow")) is done


def test_curves_of_many_heights_get_no_more(robot):
    """What follows all that is missing through a hundred heights says nothing of it, and takes minutes."""
    rest = np.random.default_rng(0).normal(size=5000)
    many = trial(with_denser_curve(with_denser_curve(robot, "sensor_bias"), "sensor_bias"), 3.0 * rest, 40)
    assert densest(many, lambda model, like: pytest.fail("68 heights")) is many


@pytest.mark.parametrize("law", ["shape", "first_order"])
def test_what_is_no_curve_through_points_is_left_as_it_is(law):
    """A step response in four drawn steps is a law without a formula, too."""
    model = Pioneer() + effect_by_id(Pioneer(), "motor_lag", law)
    lag = replace(trial(model, np.ones(500), 10), id="motor_lag")
    assert densest(lag, lambda other, like: pytest.fail("there are no points")) is lag


@pytest.mark.parametrize(
    ("identifier", "stage"),
    [("asymmetric_viscous_friction", "viscous"), ("stribeck_friction", "dry"), ("quadratic_drag", "force")],
)
def test_curves_apart_are_at_first_the_curve_that_all_shared(identifier, stage, tmp_path):
    model = Omni() + effect_by_id(Omni(), identifier, "shape")
    heights = [name for name in model.parameters if ".at_" in name]
    model = model.with_values(**{name: 0.3 + 0.1 * k for k, name in enumerate(heights)})
    model = model.change(heights[0], free=False)
    apart = with_curves_apart(model, identifier)
    assert len([name for name in apart.parameters if ".at_" in name]) == 3 * len(heights)
    assert sum(not p.free for name, p in apart.parameters.items() if ".at_" in name) == 3
    state = {"V": 0.4, "Vn": 0.0, "W": 0.0}

    def acting(robot):
        (effect,) = robot.effects
        signal = ((1.0, 1.0),) * 3 if stage == "dry" else (0.0,) * 3
        speeds = () if stage == "force" else ((0.4, -0.2, 0.7),)
        found = getattr(effect, stage)(signal, *speeds, state, robot.parameters.numbers, robot)
        return np.asarray(found, float)

    assert np.allclose(acting(apart), acting(model), rtol=1e-12) and not np.allclose(acting(apart), 0.0)
    write_model(tmp_path / "model.toml", apart)
    assert read_model(tmp_path / "model.toml", Omni()).effects == apart.effects


def test_curves_apart_are_taken_only_where_they_tell_more():
    model = Omni() + effect_by_id(Omni(), "stribeck_friction", "shape")
    noise, wave = np.random.default_rng(0).normal(size=5000), np.sin(np.arange(5000) / 300)
    shared = replace(trial(model, noise + 0.5 * wave, 10), id="stribeck_friction")

    def refitted(left):
        """Of curves apart as much of the wave as given, of more points nothing less."""
        return lambda robot, like: trial(robot, noise + (left if robot.effects[0].apart else 0.5) * wave, 18)

    assert densest(shared, refitted(0.1)).robot.effects[0].apart
    assert densest(shared, refitted(0.499)) is shared


def test_further_harmonics_leave_the_ripple_what_it_was(tmp_path):
    axis = Omni() + effect_by_id(Omni(), "cogging_torque", "two_harmonics")
    ripple = {"sine_phi1": 0.02, "cosine_2_phi3": -0.01, "periods": 5.0}
    robot = axis.with_values(**{f"cogging_torque.{name}": value for name, value in ripple.items()})
    robot = robot.change("cogging_torque.sine_2_phi2", free=False)
    more = with_further_terms(robot, "cogging_torque")
    assert more.effects[-1].law == "five_harmonics" and more.effects[-1].denser is None
    assert not more.parameters["cogging_torque.sine_2_phi2"].free

    def torques(model, values=()):
        turned = {**dict.fromkeys(model.states, 0.0), **{f"phi{k}": 0.3 * k for k in range(1, 5)}}
        return np.array(
            model.effects[-1].torque((0.0,) * 4, turned, {**model.parameters.numbers, **dict(values)}, model)
        )

    assert np.allclose(torques(more), torques(robot))
    fourth = torques(more, {"cogging_torque.cosine_4_phi2": 0.1}) - torques(more)
    assert np.allclose(fourth, [0.0, 0.1 * np.cos(4 * 5.0 * 0.6), 0.0, 0.0])
    write_model(tmp_path / "model.toml", more)
    assert read_model(tmp_path / "model.toml", Omni()).effects == more.effects


def test_a_profile_leaves_two_planes_what_they_were():
    robot = Pioneer(pose=True)
    robot = robot + effect_by_id(robot, "ground_slope", "two_planes").sharp
    planes = {"slope_x": 0.01, "change_y": -0.02, "angle": 0.5, "offset": 0.3}
    robot = robot.with_values(**{f"ground_slope.{name}": value for name, value in planes.items()})
    profile = with_further_terms(robot, "ground_slope")
    assert profile.effects[-1].law == "profile"

    def force(model, x, y, values=()):
        place = {**dict.fromkeys(model.states, 0.0), "x": x, "y": y, "theta": 0.3}
        return np.array(model.effects[-1].force((0.0, 0.0), place, {**model.parameters.numbers, **dict(values)}, model))

    places = [(0.0, 0.0), (2.0, 1.0), (-30.0, 4.0)]
    for x, y in places:
        assert np.allclose(force(profile, x, y), force(robot, x, y))
    # At a height's own place it is that height, beyond the last one level.
    reach = profile.parameters["ground_slope.reach"].value
    at_3 = {"ground_slope.at_3_x": 0.05}
    x, y = (0.3 + 0.5 * reach) * np.cos(0.5), (0.3 + 0.5 * reach) * np.sin(0.5)
    raised = {"ground_slope.slope_x": 0.01 + 0.05}
    assert np.allclose(force(profile, x, y, at_3), force(robot, x, y, raised))
    assert np.allclose(force(profile, 40.0, 25.0, at_3), force(profile, 40.0, 25.0))


def test_a_curve_that_reaches_farther_is_what_it_was():
    """Up to where it reached, and level beyond, as it was; its new points may bend it there."""
    axis = Axis() + effect_by_id(Axis(), "actuator_dead_zone", "shape")
    heights = {f"actuator_dead_zone.at_{k}": h for k, h in enumerate((0.5, 0.8, 0.6, 0.4), 1)}
    axis = axis.with_values(**heights)
    (coarse,) = axis.effects
    assert may_reach_farther(axis, coarse)
    farther = with_farther_reach(axis, "actuator_dead_zone")
    (fine,) = farther.effects
    reach = axis.parameters["actuator_dead_zone.reach"].value
    assert farther.parameters["actuator_dead_zone.reach"].value == 2 * reach and not may_reach_farther(farther, fine)
    x = 2 * reach * np.asarray(fine.places)  # between its points it may bend otherwise
    with float64():
        before, after = (np.asarray(own.at(x, r.parameters.numbers)) for own, r in ((coarse, axis), (fine, farther)))
    assert np.allclose(before, after) and np.allclose(after[x >= reach], 0.4)
    assert not may_reach_farther(axis, effect_by_id(Axis(), "quadratic_drag", "shape"))


def test_a_curve_reaches_farther_only_where_that_tells_more():
    """What is left beyond the reach of a curve is the rest of the same curve, before it is another effect."""
    axis = Axis() + effect_by_id(Axis(), "actuator_dead_zone", "shape")
    reach = axis.parameters["actuator_dead_zone.reach"].value
    noise, wave = np.random.default_rng(0).normal(size=5000), np.sin(np.arange(5000) / 300)
    near = replace(trial(axis, noise + 0.5 * wave, 10), id="actuator_dead_zone")

    def refitted(left):
        """Of a curve with a longer reach as much of the wave as given, of one with more points alone nothing less."""

        def again(robot, like):
            own = left if robot.parameters["actuator_dead_zone.reach"].value > reach else 0.499
            return trial(robot, noise + own * wave, 18)

        return again

    assert densest(near, refitted(0.1)).robot.parameters["actuator_dead_zone.reach"].value == 2 * reach
    assert densest(near, refitted(0.499)) is near


@pytest.mark.parametrize("identifier", ["actuator_dead_zone", "voltage_saturation", "traction_limit"])
def test_what_is_lost_by_each_motor_is_at_first_what_all_lost(identifier):
    """And one motor's curve leaves the others alone."""
    model = Pioneer() + effect_by_id(Pioneer(), identifier, "shape")
    names = [name for name in model.parameters if ".at_" in name]
    typical = model.parameters[names[0]].typical
    model = model.with_values(**{name: (k + 1) * typical for k, name in enumerate(names)})
    apart = with_curves_apart(model, identifier)
    own = [name for name in apart.parameters if ".at_" in name]
    assert len(own) == 2 * len(names)

    def acting(robot):
        (effect,) = robot.effects
        numbers = robot.parameters.numbers
        with float64():
            if identifier == "traction_limit":
                return np.array(effect.torque((4.0, -2.0), {}, numbers, robot))
            volts = np.array([[9.0, -3.0], [0.5, 12.0]])
            return np.asarray(effect.command(volts, None, None, numbers, robot))

    assert np.allclose(acting(apart), acting(model), rtol=1e-12)
    first = {name: 0.0 for name in own if name.endswith(("_V2", "_1")) and not name.endswith("at_1")}
    changed = acting(apart.with_values(**first)) - acting(apart)
    assert np.all(np.abs(changed[..., 0]) > 0) and np.allclose(changed[..., 1], 0.0)
