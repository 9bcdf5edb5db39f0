"""The handedness of a planar frame on a floor that slopes, from a body simulated here by small steps."""

import numpy as np
import pytest

from jaxid import Log, Omni
from jaxid.checks.preflight import preflight

DT, STEPS, SAMPLES = 0.02, 10, 800
CHANNELS = Omni().channels


def moved(slope, seed, frame, size):
    """Slow motions of a body with viscous friction; the turning frame's own terms times `frame`, -1 in one that is flipped."""
    rng, h = np.random.default_rng(seed), DT / STEPS
    modes = np.repeat(size * rng.uniform(-1.0, 1.0, (SAMPLES // 40, 3)), 40, axis=0)
    mixing = np.array([CHANNELS.mixing[name] for name in ("V", "Vn", "W")])
    V = Vn = W = theta = 0.0
    seen = np.zeros((SAMPLES, 3))
    for k, (ahead, left, turn) in enumerate(modes):
        seen[k] = V, Vn, W
        for _ in range(STEPS):
            c, s = np.cos(theta), np.sin(theta)
            along, across = 9.81 * (slope[0] * c + slope[1] * s), 9.81 * (slope[1] * c - slope[0] * s)
            rates = 2 * (ahead - V) + frame * W * Vn - along, 2 * (left - Vn) - frame * W * V - across
            V, Vn, W, theta = V + h * rates[0], Vn + h * rates[1], W + h * (6 * turn - 3 * W), theta + h * W
    seen += rng.normal(size=seen.shape) * (0.002, 0.002, 0.01)
    return Log.from_arrays("run", DT * np.arange(SAMPLES), modes @ np.linalg.pinv(mixing).T, seen, Omni())


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("frame", [1.0, -1.0])
def test_a_slope_hides_no_flipped_frame_and_makes_none(frame, seed):
    """What pulls is known but for its direction on the floor, which turns with the robot."""
    found = [f.check for f in preflight(moved((0.045, -0.03), seed, frame, 0.2))]
    assert ("frame_flipped" in found) == (frame < 0)
