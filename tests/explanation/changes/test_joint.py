"""Refits of both sets under one model: what may change stays within what it can be."""

import numpy as np
import pytest

from jaxid import DifferentialDrive, Log, LogSet, output_error
from jaxid.estimate.noise_colour import Colour
from jaxid.explanation.changes.candidates import Side
from jaxid.explanation.changes.joint import Colours, Pair, refit
from jaxid.explanation.changes.sides import SetOfLogs, side_of

TRUE = {"M": 12.0, "J": 0.4, "Fv": 0.5, "Fc": 3.0, "b": 0.2, "gain": 2.0, "back_emf": 8.0}
NOISE = (0.006, 0.02)


def robot():
    table = DifferentialDrive().parameters
    return DifferentialDrive().with_values(**{name: value for name, value in TRUE.items() if name in table})


def recorded(seed, right=1.0):
    """Logs of a differential drive whose right motor's torque constant, and with it its back-EMF, is `right` times nominal."""
    logs, h, fine, n = [], 0.02, 20, 500
    strength, rows = np.array([right, 1.0]), np.array([[1.0, TRUE["b"]], [1.0, -TRUE["b"]]])
    inertia = np.array([TRUE["M"], TRUE["J"]])
    for k in range(4):
        random, nu, seen = np.random.default_rng(10 * seed + k), np.zeros(2), []
        u = np.repeat(random.uniform(-12.0, 12.0, (n // 25, 2)), 25, axis=0)
        for volts in u:
            seen.append(nu)
            for _ in range(fine):
                rims = rows @ nu
                force = TRUE["gain"] * strength * (volts - TRUE["back_emf"] * strength * rims) - TRUE["Fv"] * rims
                free = nu + h / fine / inertia * (rows.T @ force)
                # Dry friction takes either wheel's speed away, or as much of it as it can.
                most, left = h / fine * TRUE["Fc"], np.zeros(2)
                A = rows / inertia @ rows.T
                for _ in range(8):
                    for i in range(2):
                        left[i] = np.clip(left[i] - (rows[i] @ (free + rows.T @ left / inertia)) / A[i, i], -most, most)
                nu = free + rows.T @ left / inertia
        outputs = np.array(seen) + random.normal(size=(n, 2)) * NOISE
        logs.append(Log.from_arrays(f"run {seed} {k}", h * np.arange(n), u, outputs, robot()))
    return LogSet(logs)


@pytest.fixture(scope="module")
def weaker():
    """A right motor with 6 % less torque constant: to go on as fast it would take viscous friction below none."""
    sets = recorded(1), recorded(2, right=0.94)
    return [(output_error(robot(), logs), logs) for logs in sets]


@pytest.mark.slow
def test_friction_does_not_fall_below_none(weaker):
    (before, logs), (after, later) = weaker
    sides: dict[Side, SetOfLogs] = {"before": side_of(before, logs), "after": side_of(after, later)}
    pair = Pair.of(before.robot, before.free_names, sides)
    theta = np.array([before.robot.parameters[name].value for name in pair.free])
    colours: Colours = {side: (Colour((), 1.0, 0.0),) * 2 for side in sides}
    candidate = next(own for own in pair.own if own.id == "friction_of_right_wheel")
    found = refit(pair, candidate, colours, theta)
    names = [c.name.split(".")[-1] for c in candidate.coordinates]
    assert "viscous" in names and np.all(found.delta >= -1.0)
