"""States that no output shows, against the exact states of the independent simulator."""

import numpy as np
import pytest

from jaxid import Axis, Log, LogSet, Pioneer
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
