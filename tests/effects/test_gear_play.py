"""Play between motor and wheel against `reference/gear_play.py`: two masses with stiff teeth, by SciPy's integrator."""

import numpy as np
import pytest

from jaxid import Axis, Integrator, Log, LogSet, Omni, Pioneer, Wheel, Wheeled, output_error
from jaxid.effects import effect_by_id, laws_of
from jaxid.simulation.simulate import simulate
from reference.gear_play import DAMPING, STIFFNESS, speeds

P = {"M": 2.0, "Fv": 1.0, "gain": 4.0, "back_emf": 1.5}
MOTOR, WIDTH, DT, N = 0.02, 0.08, 0.02, 240
AXIS = Axis().with_values(Fc=0.0, offset=0.0, **(P | {"M": P["M"] + MOTOR}))


@pytest.fixture(scope="module")
def driven():
    """Inputs, and what the two masses do with and without play."""
    u = np.repeat(np.random.default_rng(3).uniform(-4.0, 4.0, N // 12), 12)
    return u, speeds(P, WIDTH, MOTOR, u, DT), speeds(P, 0.0, MOTOR, u, DT)


def logs(u, v):
    return LogSet([Log.from_arrays("one", DT * np.arange(len(u)), u[:, None], v[:, None], AXIS)])


def test_gear_play_moves_an_axis_as_two_masses_with_teeth(driven):
    """The impulse is the slope of torque by speed times the width: nothing is fitted."""
    u, with_play, without = driven
    effect = effect_by_id(AXIS, "backlash", "gear_play")
    robot = (AXIS + effect).with_values(**{effect.key("impulse"): P["gain"] * P["back_emf"] * WIDTH})
    (found,) = simulate(robot, logs(u, with_play), integrator=Integrator(8))
    (plain,) = simulate(AXIS, logs(u, with_play), integrator=Integrator(8))
    size = np.sqrt(np.mean((with_play - without) ** 2))
    assert size > 0.05 and np.sqrt(np.mean((plain[:, 0] - without) ** 2)) < 0.1 * size
    assert np.sqrt(np.mean((found[:, 0] - with_play) ** 2)) < 0.15 * size


def test_a_fit_finds_the_width_of_the_play(driven):
    u, with_play, _ = driven
    effect = effect_by_id(AXIS, "backlash")
    robot = AXIS.change("Fc", free=False).change("offset", free=False) + effect
    noisy = with_play + 0.005 * np.random.default_rng(4).normal(size=N)
    impulse = P["gain"] * P["back_emf"] * WIDTH
    fit = output_error(robot, logs(u, noisy), start={effect.key("impulse"): 0.5 * impulse}, windows=None)
    assert fit[effect.key("impulse")].value == pytest.approx(impulse, rel=0.1)
    assert fit["M"].value == pytest.approx(P["M"] + MOTOR, rel=0.02)


def test_a_heavy_motor_runs_through_the_play_and_the_mass_stays_that_of_both():
    """Nothing is fitted: the law's numbers are those of the two masses and of their teeth."""
    motor, width = 0.2, 0.02
    u = np.repeat(np.random.default_rng(5).uniform(-4.0, 4.0, N // 12), 12)
    far = P | {"M": P["M"] - motor}
    with_play, without = (speeds(far, w, motor, u, DT) for w in (width, 0.0))
    effect = effect_by_id(AXIS, "backlash", "motor_behind_play")
    numbers = {
        "width": width,
        "inertia": motor,
        "ring": np.sqrt(motor / STIFFNESS),
        "damping": DAMPING / (2.0 * np.sqrt(STIFFNESS * motor)),
    }
    axis = AXIS.with_values(M=P["M"])
    robot = (axis + effect).with_values(**{effect.key(name): value for name, value in numbers.items()})
    (found,) = simulate(robot, logs(u, with_play), integrator=Integrator(16))
    (plain,) = simulate(axis, logs(u, with_play), integrator=Integrator(16))
    size = np.sqrt(np.mean((with_play - without) ** 2))
    assert size > 0.02 and np.sqrt(np.mean((plain[:, 0] - without) ** 2)) < 0.2 * size
    assert np.sqrt(np.mean((found[:, 0] - with_play) ** 2)) < 0.15 * size


def test_without_a_width_the_motor_is_a_part_of_the_robot():
    u = np.repeat(np.random.default_rng(6).uniform(-4.0, 4.0, N // 12), 12)
    for robot, inputs in (
        (AXIS, u[:, None]),
        (Pioneer(), np.stack([u, -u], axis=1)),
        (Omni(), np.stack([u] * 4, axis=1)),
    ):
        behind = robot + effect_by_id(robot, "backlash", "motor_behind_play")
        still = np.zeros((N, len(robot.channels.outputs)))
        log = LogSet([Log.from_arrays("one", DT * np.arange(N), inputs, still, robot)])
        plain, found = (simulate(model, log, integrator=Integrator(4))[0] for model in (robot, behind))
        np.testing.assert_allclose(found, plain, atol=1e-12)


def test_each_drive_can_have_its_own_play():
    assert [law.law for law in laws_of(Pioneer(), "backlash")] == [
        "gear_play",
        "motor_behind_play",
        "per_drive",
        "command",
    ]
    own = (Omni() + effect_by_id(Omni(), "backlash", "per_drive")).parameters
    assert [name for name in own if name.startswith("backlash.") and own[name].free] == [
        f"backlash.impulse_u{k}" for k in range(1, 5)
    ]
    assert [law.law for law in laws_of(AXIS, "backlash")] == ["gear_play", "motor_behind_play", "command"]


@pytest.mark.parametrize("said", [True, False])
def test_the_rotor_in_a_table_s_wheel_inertia_does_not_count_twice(said):
    """Straight ahead a wheel carries half the robot: the two masses of `reference/gear_play.py` at the rim. A table whose wheel
    inertia is 0 says nothing of the rotor, so that none is taken off."""
    r, motor, wheel, mass, width = 0.05, 4e-3, 5e-4, 3.0, 0.1
    at_rim = {"Fv": 0.02 / r**2, "gain": 0.1 / r, "back_emf": 2.0}
    u = np.repeat(np.random.default_rng(7).uniform(-12.0, 12.0, N // 12), 12)
    far = at_rim | {"M": 0.5 * mass + (wheel if said else 0.0) / r**2}
    v = speeds(far, width * r, motor / r**2, u, DT)
    wheels = Wheel("right", (0.0, -0.1)), Wheel("left", (0.0, 0.1))
    robot = Wheeled(wheels=wheels, motors=False).with_values(
        r=r, M=mass, J=0.02, Iw=motor + wheel if said else 0.0, viscous=0.02, coulomb=0.0, gain=0.1, back_emf=2.0 * r
    )
    effect = effect_by_id(robot, "backlash", "motor_behind_play")
    numbers = {
        "width": width,
        "inertia": motor,
        "ring": np.sqrt(motor / (STIFFNESS * r**2)),
        "damping": DAMPING / (2.0 * np.sqrt(STIFFNESS * motor / r**2)),
    }
    robot = (robot + effect).with_values(**{effect.key(name): value for name, value in numbers.items()})
    outputs = np.stack([v, np.zeros(N)], axis=1)
    log = Log.from_arrays("one", DT * np.arange(N), np.stack([u, u], axis=1), outputs, robot)
    (found,) = simulate(robot, LogSet([log]), integrator=Integrator(32))
    plain = speeds(far | {"M": far["M"] + motor / r**2}, width * r, motor / r**2, u, DT)
    apart = np.sqrt(np.mean((plain - v) ** 2))
    assert apart > 0.02
    assert np.sqrt(np.mean((found[:, 0] - v) ** 2)) < 0.15 * apart
