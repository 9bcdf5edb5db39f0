"""A pendulum simulated by SciPy, hanging, swinging over the top, or held upright by a controller."""

from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp

TRUTH = {"g": 9.0, "d": 0.1, "b": 1.0}
INTERVAL = 0.02


def held(amplitude: float, samples: int, each: int, seed: int = 1) -> np.ndarray:
    """A random sequence of ±amplitude, `each` samples long."""
    signs = np.random.default_rng(seed).choice([-1.0, 1.0], samples // each + 1)
    return np.repeat(amplitude * signs, each)[:samples]


def recorded(
    u: np.ndarray,
    start: tuple[float, float] = (0.0, 0.0),
    *,
    noise: float = 0.01,
    seed: int = 0,
    controller: Callable[[float, float], float] | None = None,
    **truth: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time [T], input [T, 1] and measured angle [T, 1] of SciPy's motion.

    A `controller` of the measured angle and its rate over one sample adds to u.
    """
    p, rng, x = TRUTH | truth, np.random.default_rng(seed), np.array(start, float)
    inputs, outputs, before = np.array(u, float), np.zeros(len(u)), None
    for k in range(len(u)):
        outputs[k] = x[0] + noise * rng.normal()
        if controller is not None:
            rate = 0.0 if before is None else (outputs[k] - before) / INTERVAL
            inputs[k] += controller(outputs[k], rate)
        before = outputs[k]

        def motion(t, s, v=inputs[k]):
            return [s[1], -p["g"] * np.sin(s[0]) - p["d"] * s[1] + p["b"] * v]

        x = solve_ivp(motion, (0.0, INTERVAL), x, rtol=1e-8, atol=1e-9).y[:, -1]
    return INTERVAL * np.arange(len(u)), inputs[:, None], outputs[:, None]
