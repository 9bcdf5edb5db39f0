"""MuJoCo's Pioneer against the independent simulator: two engines that share no code have to agree before one hides things."""

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the foreign engine needs the extra 'benchmarks'")
pytest.importorskip("numba", reason="the independent simulator needs numba")
from benchmarks.foreign.cases import FIRM, constants  # noqa: E402
from benchmarks.foreign.pioneer_mjcf import World  # noqa: E402
from benchmarks.foreign.simulate import drive, log_table  # noqa: E402
from reference import excitation  # noqa: E402
from reference.logs import simulate  # noqa: E402
from reference.pioneer import PARAMETERS, PIONEER  # noqa: E402

NOISE = np.array([0.01, 0.02])
REVERSING = excitation.experiment("pioneer", "prbs_reversing", 401, seed=5, level=5.0)
ANGLE, DIRECTION = 0.025, 0.6


@pytest.mark.parametrize(
    ("hidden", "delay", "effects"),
    [
        ({}, 0.0, {}),
        (
            {"slope_x": np.sin(ANGLE) * np.cos(DIRECTION), "slope_y": np.sin(ANGLE) * np.sin(DIRECTION)},
            0.0,
            {"ground_slope": {"angle": ANGLE, "direction": DIRECTION}},
        ),
        ({"shift": 0.015}, 0.0, {"lateral_com_offset": {"offset": 0.015}}),
        ({}, 0.025, {"input_delay": {"delay": 0.025}}),
    ],
    ids=["nothing", "tilted floor", "shifted mass", "delayed actuator"],
)
def test_both_engines_move_alike_within_a_fifth_of_the_noise(hidden, delay, effects):
    """The caster flips over at every reversal, so its inertia and friction, the motors and the contacts all take part."""
    p = constants(7001)
    foreign = drive(p, REVERSING, World(**(FIRM | hidden)), delay).speeds
    reference = PIONEER.with_parameters(**{name: p[name] for name in PARAMETERS})
    own = simulate(reference, REVERSING, 0.02, effects, rtol=1e-7, atol=1e-9).speeds
    rms = np.sqrt(np.mean((foreign - own) ** 2, axis=0))
    assert np.all(rms < 0.2 * NOISE)
    if effects:
        without = simulate(reference, REVERSING, 0.02, rtol=1e-7, atol=1e-9).speeds
        hidden_size = np.sqrt(np.mean(((own - without) / NOISE) ** 2))
        assert hidden_size > 10 * np.sqrt(np.mean((rms / NOISE) ** 2))


def test_steady_speed_is_that_of_the_motor_equation():
    """Both wheels turn at the speed at which eq. 28's torque, with back-EMF, equals viscous and dry friction."""
    p, volts = PARAMETERS, 4.0
    moved = drive(p, np.full((301, 2), volts), World(**FIRM))
    gain = p["tr"] * p["mu"] * p["KT"] / p["Ra"]
    dry = p["Cs"] + p["tr"] * p["mu"] * p["tau_fr"]
    turning = (gain * volts - dry) / (p["Cv"] + gain * p["KE"] * p["tr"])
    assert moved.speeds[-1, 0] == pytest.approx(p["R"] * turning, rel=1e-3)
    assert abs(moved.speeds[-1, 1]) < 1e-6


def test_below_break_away_it_rests():
    moved = drive(PARAMETERS, np.full((101, 2), 0.6), World(**FIRM))
    assert np.abs(moved.speeds).max() < 1e-4  # the engine's friction constraint creeps, far below the noise


def test_little_grip_makes_the_wheels_slip_at_a_reversal():
    volts = np.repeat([[5.0, 5.0], [-5.0, -5.0]], 60, axis=0)
    firm, slippery = (drive(PARAMETERS, volts, World(**(FIRM | {"grip": grip}))).slip for grip in (3.0, 0.3))
    assert np.abs(firm).max() < 0.005 < 0.1 < np.abs(slippery).max()


def test_a_log_holds_the_commands_and_the_noise_asked_for():
    moved = drive(PARAMETERS, REVERSING, World(**FIRM))
    table = log_table(REVERSING, moved, (0.01, 0.02), seed=3)
    assert list(table.columns) == ["t", "V2", "V3", "eta1", "eta2"]
    assert np.array_equal(table[["V2", "V3"]], REVERSING)
    spread = np.std(table[["eta1", "eta2"]] - moved.speeds, axis=0)
    assert np.allclose(spread, NOISE, rtol=0.15)
