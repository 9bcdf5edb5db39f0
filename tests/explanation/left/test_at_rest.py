"""Slow noise of a sensor or a disturbance of the motion: what is left while the robot stands tells."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import signal

from jaxid import AXIS, Axis, DifferentialDrive, Log, LogSet, explain, output_error
from jaxid.estimate.noise_colour import colour_of
from jaxid.explanation.left import at_rest
from jaxid.explanation.left.at_rest import held_rates

DT, FINE, SAMPLES = 0.02, 20, 900
M, FV, FC = 1.3, 2.1, 0.8


def axis_motion(u, force):
    """Speeds [T] of an axis with dry friction that sticks, under `u` and a disturbing `force` [T], by implicit Euler steps."""
    v, found, h = 0.0, [], DT / FINE
    for drive in u + force:
        found.append(v)
        for _ in range(FINE):
            free = M * v + h * drive
            v = np.sign(free) * max(abs(free) - h * FC, 0.0) / (M + h * FV)
    return np.array(found)


def wander(rng, memory):
    """Slow noise of unit variance, forgotten within `memory` samples."""
    rho = np.exp(-1.0 / memory)
    return signal.lfilter([np.sqrt(1 - rho**2)], [1.0, -rho], rng.normal(size=SAMPLES + 500))[500:]


def explained(force, bias):
    """The explanation of nine logs of a robot as it is, with a disturbing `force`, and a wandering `bias` of the sensor."""
    logs = []
    for seed in range(9):
        rng = np.random.default_rng(300 + seed)
        u = np.repeat(rng.uniform(1.2, 5.0, 18) * rng.choice([-1, 0, 0, 1], 18), SAMPLES // 18)
        v = axis_motion(u, force * wander(rng, 30)) + bias * wander(rng, 30) + 0.02 * rng.normal(size=SAMPLES)
        logs.append(Log.from_arrays(f"run {seed}", DT * np.arange(SAMPLES), u[:, None], {"v": v}, AXIS))
    robot = Axis().with_values(M=1.0, Fv=1.5, Fc=0.5, offset=0.0).change("offset", free=False)
    fit = output_error(robot, LogSet(logs[:6]))
    return explain(fit, LogSet(logs[:6]), LogSet(logs[6:]))


@pytest.mark.slow
def test_a_sensor_that_wanders_is_no_alarm():
    found = explained(0.0, 0.02)
    assert found.verdict == "adequate" and not found.effects
    assert found.colour is not None and not found.colour.simple and found.colour.at_rest
    assert "slow noise of the sensor, which is there while the robot stands, too" in found.sentence
    assert found.to_dict()["colour"]["while_the_robot_stands"] is True


@pytest.mark.slow
def test_a_disturbance_that_dry_friction_holds_is_told_as_one():
    found = explained(0.05, 0.0)
    assert found.verdict == "unexplained" and not found.effects
    assert found.colour is not None and found.colour.at_rest is False
    assert "is a disturbance of the motion" in found.sentence and "held by dry friction" in found.sentence


def test_what_dry_friction_holds_is_coulomb_friction_over_inertia():
    robot = Axis().with_values(M=1.3, Fv=2.1, Fc=0.8)
    np.testing.assert_allclose(held_rates(robot), [0.8 / 1.3], rtol=1e-6)
    assert held_rates(robot.with_values(Fc=0.0)).max() == 0.0


def test_both_sides_of_a_drive_hold_it_against_turning():
    robot = DifferentialDrive().with_values(M=10.0, J=0.5, b=0.2, Fc=2.0)
    p = robot.parameters.numbers
    forward, turning = held_rates(robot)
    # A force F on each side: both forward make 2 F / M, one against the other 2 F b / J.
    levels = [pair[0] for pair in robot.coulomb(robot.initial_state(), p)]
    np.testing.assert_allclose([forward, turning], [2 * levels[0] / 10.0, 2 * levels[0] * 0.2 / 0.5], rtol=1e-6)


@pytest.mark.parametrize("mass", [0.5, 40.0])
def test_more_mass_is_held_against_less_change(mass):
    robot = Axis().with_values(M=mass, Fv=1.0, Fc=2.0)
    np.testing.assert_allclose(held_rates(robot) * mass, [2.0], rtol=1e-6)


def rests_of(noises, seed=5):
    """Rests of a log for each of `noises`, with the colour of its motion: a memory in samples, sizes in motion and at rest."""
    found = []
    for k, (memory, moving, still) in enumerate(noises):
        own = (
            wander(np.random.default_rng([seed, k]), memory)
            if memory
            else np.random.default_rng(k).normal(size=SAMPLES)
        )
        stood = np.zeros(SAMPLES, bool)
        stood[100:160] = stood[400:480] = stood[600:640] = True
        residual = own * np.where(stood, still, moving)
        colour = at_rest._colour_here(residual, stood)
        assert colour is not None
        found.append(at_rest._Rest([residual[a:b] for a, b in at_rest._runs(stood)], colour))
    assert at_rest._colour_here(np.ones(SAMPLES), np.arange(SAMPLES) > 50) is None  # it moves too little to tell
    return found


@pytest.mark.parametrize("seed", range(5))
def test_logs_of_sensors_with_another_noise_each_are_held_against_their_own(seed):
    """White and large in one, slow and small in the next: all of it together at rest is the colour of neither."""
    same = rests_of([(0, 3.0, 3.0), (4, 0.6, 0.6), (0, 2.0, 2.0), (3, 1.0, 1.0)], seed)
    pooled = colour_of([part for rest in same for part in rest.parts])
    assert at_rest._there(same, pooled, 0.0) is True
    assert at_rest._there([at_rest._Rest(rest.parts, pooled) for rest in same], pooled, 0.0) is False
    held = rests_of([(4, 3.0, 0.3), (4, 0.6, 0.1), (0, 1.0, 1.0), (3, 1.0, 0.1)], seed)
    assert at_rest._there(held, pooled, 0.0) is False


@pytest.mark.parametrize("late", [0, 8])
def test_a_robot_that_stops_a_little_later_than_the_simulated_one_shows_no_noise_of_the_sensor(late):
    """What a push up a slope leaves at the beginning of every rest is motion, and is not there once the robot stands."""
    robot, noise, slow = Axis().with_values(M=1.0, Fv=1.0, Fc=0.5), 0.01, 2.5
    stood = np.zeros(SAMPLES, bool)
    rests = [(100, 160), (400, 480), (600, 640)]
    for a, b in rests:
        stood[a:b] = True
    residuals = []
    for seed in range(3):
        rng = np.random.default_rng([41, seed])
        own = slow * wander(rng, 30) * ~stood + rng.normal(size=SAMPLES)
        for a, _ in rests:
            own[a : a + late] += slow * 2.0 * np.linspace(1.0, 0.0, late, endpoint=False)
        residuals.append(own[:, None])
    colour = colour_of([own[:, 0] for own in residuals])
    state = SimpleNamespace(residuals=residuals, noise={"v": noise}, by_channel={"v": slow})
    scales = SimpleNamespace(time=1.0, interval=DT)
    assert at_rest.shown_at_rest(robot, [(state, None)], [[stood] * 3], {"v": colour}, scales) is False
