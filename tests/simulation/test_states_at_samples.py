"""States that no output shows, against the exact states of the independent simulator."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxid import Axis, Channels, Custom, Log, LogSet, Parameter, ParameterTable, Pioneer
from jaxid.estimate.output_error.predictability import predictability
from jaxid.logs.windows import in_windows
from jaxid.simulation.start import initial_states, states_at

pytest.importorskip("numba", reason="the independent simulator needs numba")


def driven(kind, measured, noise):
    """A Pioneer's run with its true states [T, states], and its log of the speeds or of the wheels' angles."""
    from reference.excitation import experiment
    from reference.logs import simulate
    from reference.pioneer import PIONEER, STATES

    rng, u = np.random.default_rng(4), experiment("pioneer", kind, 600, 3)
    run = simulate(PIONEER, u, 0.02)
    robot = Pioneer(wheel_angles=measured[0] == "phi2")
    seen = {name: run.states[:, STATES.index(name)] + noise * rng.normal(size=600) for name in measured}
    true = {name: run.states[:, STATES.index(name)] for name in ("beta", "eta1", "eta2")}
    return robot, Log.from_arrays(kind, run.t, u, seen, robot), true


@pytest.mark.parametrize("measured", [("eta1", "eta2"), ("phi2", "phi3")])
@pytest.mark.parametrize("kind", ["prbs_reversing", "steps"])
def test_a_casters_angle_is_carried_along_though_nothing_measures_it(kind, measured):
    robot, log, true = driven(kind, measured, 0.002)
    found = states_at(robot, log, np.arange(len(log)))
    assert np.ptp(true["beta"]) > np.pi  # it has turned about, driven backwards
    off = np.angle(np.exp(1j * (found["beta"] - true["beta"])))
    assert np.sqrt(np.mean(off**2)) < 0.15


def test_windows_begin_where_the_logs_that_they_were_cut_from_tell():
    robot, log, true = driven("prbs_reversing", ("phi2", "phi3"), 0.001)
    windows = in_windows(LogSet([log]), 1.0)
    begun = initial_states(robot, windows)
    first = np.searchsorted(log.time, [own.time[0] for own in windows])
    off = np.angle(np.exp(1j * (begun.states["beta"] - true["beta"][first])))
    assert begun.uncertain.all() and np.sqrt(np.mean(off**2)) < 0.2
    assert np.sqrt(np.mean((begun.states["eta1"] - true["eta1"][first]) ** 2)) < 0.1


def test_a_position_that_no_log_holds_follows_from_the_speed():
    """Of a mass under a steady force, in closed form."""
    robot = Axis().with_values(M=1.0, Fv=1.0, Fc=0.0, offset=0.0)
    time = 0.02 * np.arange(300)
    v = 1.0 - np.exp(-time)
    log = Log.from_arrays("step", time, np.ones((300, 1)), {"v": v}, robot)
    found = states_at(robot, log, np.arange(300))
    np.testing.assert_allclose(found["q"], time - v, atol=2e-3)


@pytest.mark.parametrize("named", [("v", "w"), ("wheel", "gyro")])
def test_a_steering_angle_is_not_read_from_a_yaw_rate_at_standstill(named):
    """A car that stops and goes: where it stands, its yaw rate is noise alone, which no angle explains. The speed may be a
    state that is measured, or be told by something that is none, such as a wheel's turns."""
    turns = 1.0 if named[0] == "v" else 16.0

    def dynamics(state, u, p):
        return {"v": (u["force"] - p["fv"] * state["v"]) / p["mass"], "delta": (u["steer"] - state["delta"]) / 0.1}

    def output(state, u, p):
        return {named[0]: turns * state["v"], named[1]: state["v"] * jnp.tan(state["delta"]) / 0.3}

    table = ParameterTable({"mass": Parameter(1.0, "kg", free=True), "fv": Parameter(2.0, "N s/m", free=True)})
    units = {"force": "N", "steer": "rad", named[1]: "rad/s"} | {named[0]: "m/s" if turns == 1.0 else "rad/s"}
    channels = Channels(inputs=("force", "steer"), outputs=named, units=units)
    names = ("v", "delta")
    robot = Custom(dynamics=dynamics, output=output, state_names=names, own_channels=channels, table=table, title="car")
    rng = np.random.default_rng(3)
    force = np.repeat(rng.choice([0.0, 0.0, 2.0, 4.0, -2.0], 25), 40)
    steer = np.repeat(rng.uniform(-0.4, 0.4, 25), 40)
    v, delta = np.zeros(1000), np.zeros(1000)
    for k in range(999):
        v[k + 1] = force[k] / 2 + (v[k] - force[k] / 2) * np.exp(-0.04)
        delta[k + 1] = steer[k] + (delta[k] - steer[k]) * np.exp(-0.2)
    seen = {
        named[0]: turns * (v + 0.01 * rng.normal(size=1000)),
        named[1]: v * np.tan(delta) / 0.3 + 0.02 * rng.normal(size=1000),
    }
    log = Log.from_arrays("stop and go", 0.02 * np.arange(1000), np.stack([force, steer], 1), seen, robot)
    found = states_at(robot, log, np.arange(1000))
    assert np.mean(np.abs(v) < 0.01) > 0.05  # it has stood
    assert np.abs(found["delta"]).max() < 1.0 and np.abs(found["v"] - v).max() < 0.5
    quick = np.abs(v) > 0.5
    assert np.sqrt(np.mean((found["delta"] - delta)[quick] ** 2)) < 0.02
    assert predictability(robot, LogSet([log])).kind == "stable"
