"""jaxid/estimate/output_error/rescue.py: parameters with which a search has run away, against a simulation written out here."""

import numpy as np
import pytest

from jaxid import Log, LogSet, Wheel, Wheeled, output_error

R, IW, A, B = 0.0475, 0.0091, 0.2355, 0.15
PLACES = {"fl": (A, B), "fr": (A, -B), "rl": (-A, B), "rr": (-A, -B)}
RIMS = np.array([[1, -1, -1], [1, 1, 1], [1, 1, -1], [1, -1, 1]]) * [1, 1, A + B]
TRUE = {"M": 24.0, "J": 1.2, "viscous": 0.6, "gain": 0.87}


def base():
    """A Mecanum base driven by currents, of whose torques nothing is known but the inertia of its wheels."""
    wheels = tuple(Wheel(name, at, kind="mecanum") for name, at in PLACES.items())
    robot = Wheeled(wheels=wheels, motors=False).with_values(r=R, Iw=IW, coulomb=0.0)
    return robot.change("coulomb", free=False).change("gain", free=True)


def driven(seed):
    """Three of its logs by Euler's method. All masses, frictions and the gain times any number are one robot, but for the
    wheels' inertia, which turns with no body."""
    random, logs = np.random.default_rng(seed), []
    m, inertia = TRUE["M"], np.diag([TRUE["M"], TRUE["M"], TRUE["J"]]) + IW / R**2 * RIMS.T @ RIMS
    for k in range(3):
        currents, v, seen = np.repeat(random.uniform(-12, 12, (30, 4)), 25, axis=0), np.zeros(3), []
        for row in currents:
            seen.append(v)
            for _ in range(20):
                turned = np.array([m * v[2] * v[1], -m * v[2] * v[0], 0.0])
                pushed = RIMS.T @ (TRUE["gain"] * row - TRUE["viscous"] * RIMS @ v / R) / R
                v = v + 0.001 * np.linalg.solve(inertia, pushed + turned)
        outputs = np.array(seen) + random.normal(size=(750, 3)) * [0.006, 0.006, 0.02]
        logs.append(Log.from_arrays(f"{k}", 0.02 * np.arange(750), currents, outputs, base()))
    return LogSet(logs)


@pytest.mark.parametrize("seed", [0, 6])
def test_a_search_that_ran_away_with_all_masses_comes_back_where_the_logs_know_them(seed):
    fit = output_error(base(), driven(seed))
    for name, true in TRUE.items():
        assert fit[name].status == "identified" and abs(fit[name].value - true) < 3.0 * fit[name].std_error, name
    assert fit["M"].std_error < 0.15 * TRUE["M"]
