"""jaxid/simulation/local_slopes.py: machine code against XLA and against differences of simulations."""

import numpy as np
import pytest

from jaxid import Axis, DifferentialDrive, Integrator, Log, LogSet, Omni, float64, simulate
from jaxid.simulation import local_slopes
from jaxid.simulation.local_slopes import output_slopes, transitions

ROBOTS = (DifferentialDrive(), Omni())


def somewhere(robot, W=11, n=4):
    """States in motion, none of whose rubbing speeds changes its sign within the stretch; inputs; intervals."""
    rng = np.random.default_rng(3)
    starts = {name: rng.uniform(0.4, 0.6, W) for name in robot.states}
    return starts, rng.uniform(0.5, 1.0, (W, n, len(robot.channels.inputs))), rng.uniform(1e-3, 2e-3, (W, n))


@pytest.mark.parametrize("robot", ROBOTS, ids=lambda robot: robot.name)
def test_machine_code_and_xla_agree(robot, monkeypatch):
    starts, inputs, dt = somewhere(robot)
    names, found = robot.estimated_states, []
    for backend in ("cpu", "none that has machine code"):
        monkeypatch.setattr(local_slopes.jax, "default_backend", lambda backend=backend: backend)
        with float64():
            passed = transitions(robot, Integrator(2), names, starts, inputs, dt)
            found.append((*passed, *output_slopes(robot, names, starts, inputs[:, 0], 0.01)))
    for one, other in zip(*found, strict=True):
        assert one.shape == other.shape and one.shape[0] == 11
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9 * np.abs(other).max())


def test_a_transition_is_what_a_simulation_started_elsewhere_does():
    robot, names = Axis(), ("q", "v")
    starts, inputs, dt = somewhere(robot)
    with float64():
        phi, seen = transitions(robot, Integrator(2), names, starts, inputs, dt)
    time = np.concatenate([[0.0], np.cumsum(dt[0])])
    u = np.concatenate([inputs[0], inputs[0, -1:]])
    logs = LogSet([Log.from_arrays("run", time, u, np.zeros((len(time), 2)), robot.channels)])

    def ended(**start):
        return simulate(
            robot, logs, start={name: np.array([value]) for name, value in start.items()}, integrator=Integrator(2)
        )[0][-1]

    here = {name: float(starts[name][0]) for name in names}
    order = [list(robot.channels.measured).index(name) for name in names]
    for k, name in enumerate(names):
        moved = (ended(**here | {name: here[name] + 1e-4}) - ended(**here | {name: here[name] - 1e-4})) / 2e-4
        np.testing.assert_allclose(phi[0, :, k], moved[order], rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(np.abs(seen).sum(axis=(1, 2)), 2.0)  # both are measured as they are
