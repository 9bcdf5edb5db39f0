"""Windows of a cart that a controller balances: of a complete model nothing that is left follows the motion, though what a
window predicts has the noise of the samples before."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import solve_discrete_are

from jaxid import Channels, Custom, Log, LogSet, Parameter, output_error

DT, N, NOISE = 0.01, 600, np.array([0.004, 0.02, 0.01])
TRUE = {"cart": 1.5, "rod": 3.0, "length": 0.25, "spin": 0.06, "gain": 4.0, "drag": 6.0}


def accelerations(th, q, v, u, p, sin, cos, push=0.0):
    """Of the rod's angle and of the cart, from both masses' equations of motion."""
    force = p["gain"] * u - p["drag"] * v + push
    a, b = p["cart"] + p["rod"], p["rod"] * p["length"] * cos(th)
    c = p["spin"] + p["rod"] * p["length"] ** 2
    x, y = force + p["rod"] * p["length"] * q**2 * sin(th), p["rod"] * 9.81 * p["length"] * sin(th)
    return (a * y - b * x) / (a * c - b * b), (c * x - b * y) / (a * c - b * b)


def robot():
    def dynamics(s, u, p):
        turning, ahead = accelerations(s["th"], s["q"], s["v"], u["u"], p, jnp.sin, jnp.cos)
        return {"th": s["q"], "q": turning, "v": ahead}

    known = ("cart", "rod", "length")
    return Custom(
        dynamics=dynamics,
        state_names=("th", "q", "v"),
        own_channels=Channels(inputs=("u",), outputs=("th", "q", "v")),
        table={name: Parameter(value, free=name not in known, lower=0.0) for name, value in TRUE.items()},
    )


def balanced(seed, push=lambda v: 0.0):
    """A log by SciPy: random reference speeds, a controller that knows the linear plant, and the noise that it sees."""
    rng = np.random.default_rng(seed)

    def rates(x, u):
        turning, ahead = accelerations(*x, u, TRUE, np.sin, np.cos, push(x[2]))
        return np.array([x[1], turning, ahead])

    A = np.stack([(rates(h, 0.0) - rates(-h, 0.0)) / 2e-6 for h in 1e-6 * np.eye(3)], axis=1)
    A, B = np.eye(3) + DT * A, DT * (rates(np.zeros(3), 1e-6) / 1e-6)[:, None]
    S = solve_discrete_are(A, B, np.diag([1.0, 0.1, 2.0]), np.array([[0.05]]))
    gains = np.linalg.solve(np.array([[0.05]]) + B.T @ S @ B, B.T @ S @ A)[0]
    wanted = np.repeat(rng.uniform(-0.4, 0.4, N // 100), 100) + np.repeat(rng.uniform(-0.1, 0.1, N // 10), 10)
    x, inputs, measured = np.array([0.02, 0.0, 0.0]), [], []
    for target in wanted:
        measured.append(x + NOISE * rng.standard_normal(3))
        inputs.append(-gains @ (measured[-1] - [0.0, 0.0, target]))
        x = solve_ivp(lambda t, y, u=inputs[-1]: rates(y, u), (0.0, DT), x, rtol=1e-8, atol=1e-10).y[:, -1]
    return Log.from_arrays(f"run {seed}", DT * np.arange(N), np.array(inputs)[:, None], np.array(measured), robot())


@pytest.mark.parametrize("seed", [1, 3])
def test_nothing_follows_the_motion_of_a_complete_model(seed):
    fit = output_error(robot(), LogSet([balanced(seed), balanced(seed + 1)]), windows=0.8)
    assert fit.judgement.trustworthy and not fit.judgement.follows
    for name in ("spin", "gain", "drag"):
        assert abs(fit[name].value - TRUE[name]) < 3.5 * fit[name].std_error


def test_what_is_missing_follows_it_all_the_same():
    missing = [balanced(seed, lambda v: -3.0 * np.tanh(v / 0.05)) for seed in (1, 2)]  # dry friction
    fit = output_error(robot(), LogSet(missing), windows=0.8)
    assert fit.judgement.verdict == "poor" and fit.judgement.follows
