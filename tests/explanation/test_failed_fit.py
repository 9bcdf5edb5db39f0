"""What is missing in a fit that went where nothing moves: found from where it began, on a skid-steered robot of our own."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxid import DifferentialDrive, Log, LogSet, explain, output_error
from jaxid.explanation.screening.first_look import begun_at

M, J, FV, B = 9.3, 0.21, 4.1, 0.17
SCRUB, KNEE = 0.5, 0.15
DT, NOISE = 0.02, (0.005, 0.015)


def log(name, seed, robot):
    """Two wheels' forces, held; wheels scrub sideways with a moment that grows to its full size within a small yaw rate."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(-4.0, 4.0, (30, 2)), 15, axis=0)

    def derivative(t, state, right, left):
        v, w = state
        ahead, back = right - FV * (v + B * w), left - FV * (v - B * w)
        return (ahead + back) / M, (B * (ahead - back) - SCRUB * np.clip(w / KNEE, -1.0, 1.0)) / J

    state, seen = np.zeros(2), []
    for right, left in u:
        seen.append(state)
        state = solve_ivp(derivative, (0.0, DT), state, args=(right, left), rtol=1e-6, atol=1e-8).y[:, -1]
    u = u if robot.channels.inputs[0] == "u_right" else u[:, ::-1]
    outputs = np.array(seen) + np.array(NOISE) * rng.normal(size=(len(u), 2))
    return Log.from_arrays(name, DT * np.arange(len(u)), u, outputs, robot.channels)


@pytest.mark.slow
def test_a_moment_that_holds_the_robot_still_is_named_though_the_fit_without_it_failed():
    robot = DifferentialDrive().with_values(b=B, Fv=FV, Fc=0.0).change("Fv", free=False).change("Fc", free=False)
    fitted = LogSet([log("a", 0, robot), log("b", 1, robot), log("c", 2, robot)])
    fit = output_error(robot, fitted)
    assert fit.failed and fit["J"].value > 5.0 * J  # turned by nothing, since nothing is known to hold it
    assert begun_at(fit)["J"] == robot.parameters["J"].value
    found = explain(fit, fitted, LogSet([log("held", 3, robot)]))
    assert found.verdict == "named" and [effect.id for effect in found.effects] == ["turning_friction"]
    assert found.after.adequate
    for name, truth in {"M": M, "J": J}.items():
        assert abs(found.final[name].value - truth) < 4.0 * found.final[name].std_error, name
