"""What explains the logs of a robot does not depend on the units in which somebody logged it: an axis, a pendulum that a user
wrote and whose speed nobody measures, and a differential drive."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxid import (
    Axis,
    Channels,
    Custom,
    DifferentialDrive,
    DriveAxis,
    Integrator,
    Log,
    LogSet,
    Parameter,
    explain,
    output_error,
    simulate,
)
from jaxid.effects import effect_by_id
from jaxid.logs import AXIS
from jaxid.simulation.scaled import scales_of

TRUTH = {"M": 1.3, "Fv": 1.6, "Fc": 0.6, "offset": 0.05}
HIDDEN = {"quadratic_drag.coefficient": 0.9}
N, DT, NOISE = 500, 0.02, 0.004
UNITS = [(1.0, 1.0, 1.0), (1e-3, 1e3, 1.0), (1e3, 1.0, 1e-3), (30.0, 1e-3, 1e3)]
"""How many times as large the units of time, length and force (the input) are."""


def axis(time, length, force, **more):
    """The axis with its true numbers in these units: numbers shrink as units grow."""
    si = {"M": length / (force * time**2), "Fv": length / (force * time), "Fc": 1 / force, "offset": 1 / force}
    return Axis().with_values(**{name: value * si[name] for name, value in TRUTH.items()})


@pytest.fixture(scope="module")
def recorded():
    """Runs in SI units of an axis with quadratic drag, with noise: (inputs, speeds) each."""
    hidden = Axis().with_values(**TRUTH)
    hidden = (hidden + effect_by_id(hidden, "quadratic_drag")).with_values(**HIDDEN)
    runs = []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        u = np.repeat(rng.uniform(-6, 6, N // 25), 25)
        log = Log.from_arrays("a", DT * np.arange(N), u[:, None], np.zeros((N, 2)), AXIS)
        v = simulate(hidden, LogSet([log]), integrator=Integrator(8))[0][:, 0]
        runs.append((u, v + NOISE * rng.normal(size=N)))
    return runs


def logs_in(runs, time, length, force):
    return LogSet(
        [
            Log.from_arrays(f"run {k}", DT * np.arange(N) / time, u[:, None] / force, v[:, None] * time / length, AXIS)
            for k, (u, v) in enumerate(runs)
        ]
    )


def explained(runs, time, length, force):
    logs = logs_in(runs, time, length, force)
    fit = output_error(axis(time, length, force), logs[:2])
    found = explain(fit, logs[:2], logs[2:])
    names = tuple(effect.id for effect in found.effects)
    back = {"M": force * time**2 / length, "Fv": force * time / length, "Fc": force, "offset": force}
    numbers = {name: found.final[name].value * factor for name, factor in back.items()}
    key = "quadratic_drag.coefficient"
    if key in found.final.robot.parameters:
        numbers[key] = found.final[key].value * force * time**2 / length**2
    return found.verdict, names, numbers, {name: found.final[name].std_error for name in back}, back


@pytest.mark.slow
def test_the_same_names_and_numbers_in_any_units(recorded):
    verdict, names, numbers, errors, _ = explained(recorded, *UNITS[0])
    assert (verdict, names) == ("named", ("quadratic_drag",))
    assert numbers["quadratic_drag.coefficient"] == pytest.approx(0.9, rel=0.1)
    for units in UNITS[2:]:
        other = explained(recorded, *units)
        assert other[:2] == (verdict, names), units
        for name, value in numbers.items():
            tolerance = 1e-3 * errors.get(name, 0.1 * abs(value))
            assert other[2][name] == pytest.approx(value, abs=tolerance), (units, name)


def test_scales_follow_the_units(recorded):
    si = scales_of(Axis().with_values(**TRUTH), logs_in(recorded, 1, 1, 1))
    for time, length, force in UNITS[1:]:
        own = scales_of(axis(time, length, force), logs_in(recorded, time, length, force))
        for name, factor in {
            "input": 1 / force,
            "speed": time / length,
            "torque": 1 / force,
            "friction": 1 / force,
            "time": 1 / time,
            "interval": 1 / time,
            "length": 1 / length,
            "angle": 1 / length,
            "acceleration": time**2 / length,
        }.items():
            assert getattr(own, name) == pytest.approx(getattr(si, name) * factor, rel=1e-4), name


# -- a user's pendulum: angle out, speed never measured ------------------------------------------------------------
PENDULUM_UNITS = [(1.0, 1.0), (1e3, 1e-3)]
"""How many times as large the units of time and torque are; an angle is an angle."""


def swinging(s, u, p, friction):
    force = u["u"] - p["weight"] * jnp.sin(s["q"]) - p["d"] * s["v"] - friction["joint"]
    return {"q": s["v"], "v": force / p["J"]}


def motor(s, u, p):
    return u["u"]


def pendulum(time, torque):
    si = {"J": (0.3, 1 / (torque * time**2)), "d": (0.25, 1 / (torque * time)), "Fc": (0.05, 1 / torque)}
    si["weight"] = (1.0, 1 / torque)
    table = {name: Parameter(value * factor, free=name != "weight", lower=0.0) for name, (value, factor) in si.items()}
    return Custom(
        dynamics=swinging,
        state_names=("q", "v"),
        own_channels=Channels(("u",), ("q",), units={"q": "rad"}),
        table=table,
        axes={"joint": DriveAxis("v", "Fc", "d", torque=motor, angle="q")},
        forces={"v": "J"},
        velocities=("v",),
        title="pendulum",
    )


def differential(time, length, force):
    si = {"M": (8.0, length / (force * time**2)), "J": (0.25, 1 / (force * length * time**2)), "b": (0.2, 1 / length)}
    si |= {"Fv": (6.0, length / (force * time)), "Fc": (1.2, 1 / force)}
    return DifferentialDrive().with_values(**{name: value * factor for name, (value, factor) in si.items()})


def lacking(robot, effect, values, amplitude, noise):
    """Three runs of `robot` with an effect, in SI units: (inputs, outputs) each."""
    hidden = (robot + effect_by_id(robot, effect)).with_values(**values)
    nu, runs = len(robot.channels.inputs), []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        u = np.repeat(rng.uniform(-amplitude, amplitude, (N // 25, nu)), 25, axis=0)
        log = Log.from_arrays("a", DT * np.arange(N), u, np.zeros((N, len(robot.channels.measured))), robot.channels)
        y = simulate(hidden, LogSet([log]), integrator=Integrator(8))[0][:, : len(robot.channels.outputs)]
        runs.append((u, y + np.array(noise) * rng.normal(size=y.shape)))
    return runs


def named_in(robot, runs, time, of_inputs, of_outputs):
    logs = LogSet(
        [
            Log.from_arrays(
                f"run {k}", DT * np.arange(N) / time, u / of_inputs, y / np.array(of_outputs), robot.channels
            )
            for k, (u, y) in enumerate(runs)
        ]
    )
    found = explain(output_error(robot, logs[:2]), logs[:2], logs[2:], most=1)
    places = () if found.localisation is None else tuple(c.name for c in found.localisation.standing_out)
    return found.verdict, tuple(effect.id for effect in found.effects), places


@pytest.mark.slow
def test_a_users_pendulum_lacks_the_same_in_any_units():
    runs = lacking(pendulum(1.0, 1.0), "quadratic_drag", {"quadratic_drag.coefficient": 0.3}, 1.2, [0.003])
    first = named_in(pendulum(1.0, 1.0), runs, 1.0, 1.0, [1.0])
    assert first[:2] == ("named", ("quadratic_drag",))
    for time, torque in PENDULUM_UNITS[1:]:
        assert named_in(pendulum(time, torque), runs, time, torque, [1.0]) == first, (time, torque)


@pytest.mark.slow
def test_a_differential_drive_lacks_the_same_in_any_units():
    si = (1.0, 1.0, 1.0)
    runs = lacking(differential(*si), "asymmetric_friction", {"asymmetric_friction.asymmetry": 0.3}, 6.0, [0.004, 0.01])
    first = named_in(differential(*si), runs, 1.0, 1.0, [1.0, 1.0])
    assert first[:2] == ("named", ("asymmetric_friction",))
    for time, length, force in UNITS[1:2]:
        found = named_in(differential(time, length, force), runs, time, force, [length / time, 1.0 / time])
        assert found[:2] == first[:2], (time, length, force)
