"""Slopes of equations whose positions are the simulation's own, on a cart on a spring in closed form."""

import numpy as np
from scipy.linalg import expm

import jaxid
from jaxid.estimate.linear.position_slopes import whole_slopes
from jaxid.estimate.linear.refined_instruments import refined_instruments
from jaxid.estimate.linear.simulated_motion import followed_simulation

TRUTH = {"a": 0.8, "k": 2.0}
SPEEDS = ("v",)
CART = jaxid.Custom(
    dynamics=lambda s, u, p: {"q": s["v"], "v": u["u"] - p["a"] * s["v"] - p["k"] * s["q"]},
    state_names=("q", "v"),
    own_channels=jaxid.Channels(inputs=("u",), outputs=SPEEDS),
    table={name: jaxid.Parameter(value, free=True) for name, value in TRUTH.items()},
)


def clean_log(samples=300, dt=0.02):
    """Speeds of the cart from rest under held forces, exact."""
    u = np.repeat(np.random.default_rng(4).uniform(-2, 2, samples // 15), 15)
    system = np.array([[0, 1, 0], [-TRUTH["k"], -TRUTH["a"], 1], [0, 0, 0]]) * dt
    onward, states = expm(system), [np.zeros(2)]
    for force in u[:-1]:
        states.append((onward @ np.append(states[-1], force))[:2])
    return jaxid.Log.from_arrays("spring", dt * np.arange(samples), u, np.array(states)[:, 1:], CART.channels)


def test_a_step_along_the_whole_slopes_finds_the_truth_where_the_regressors_alone_overshoot():
    with jaxid.float64():
        logs, true = jaxid.LogSet([clean_log()]), np.array([TRUTH["a"], TRUTH["k"]])
        off = true * np.array([1.02, 0.97])
        there = CART.with_values(a=off[0], k=off[1])
        simulated = followed_simulation(there, logs)
        assert simulated is not None
        found = refined_instruments(there, list(logs), simulated, SPEEDS, off)
        whole = whole_slopes(there, logs, SPEEDS, off, 1e-3 * true, found)
        Z, moment = found.instruments, found.instruments.T @ (found.targets - found.regressors @ off)
        by_whole, by_regressors = (off + np.linalg.solve(Z.T @ F, moment) for F in (whole, found.regressors))
    assert np.all(np.abs(by_whole - true) < 0.1 * np.abs(off - true))
    assert np.any(np.abs(by_regressors - true) > 0.3 * np.abs(off - true))
