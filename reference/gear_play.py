"""A drive axis whose motor has an inertia of its own and whose gear has play: two masses that push one another by stiff teeth.

    m q_m'' = gain (u - back_emf q_m') - F,    M q'' = F - Fv q',    F = k (gap beyond half the play) + d (closing speed)

with teeth that push and never pull. By SciPy's implicit integrator, a held input at a time.
"""

from collections.abc import Mapping

import numpy as np
from scipy.integrate import solve_ivp

STIFFNESS, DAMPING = 4e4, 60.0  # N/m, N s/m


def teeth(gap: float, closing: float, half: float) -> float:
    """Force [N] of the motor's teeth on the load's at a gap (motor's place less the load's) that closes at a speed."""
    if abs(gap) <= half:
        return 0.0
    beyond = gap - half if gap > 0 else gap + half
    force = STIFFNESS * beyond + DAMPING * closing
    return max(force, 0.0) if gap > 0 else min(force, 0.0)


def speeds(p: Mapping[str, float], width: float, motor: float, inputs: np.ndarray, sampling: float) -> np.ndarray:
    """Speed [m/s] of the load (N,) at the samples, from rest in the middle of a play of `width` [m].

    :param p: M, Fv, gain, back_emf.
    :param motor: the motor's inertia [kg]; p["M"] is the load's alone.
    :param inputs: (N,), held from a sample to the next.
    """

    def rates(t: float, x: np.ndarray, u: float) -> list[float]:
        force = teeth(x[0] - x[2], x[1] - x[3], 0.5 * width)
        pushed = p["gain"] * (u - p["back_emf"] * x[1]) - force
        return [x[1], pushed / motor, x[3], (force - p["Fv"] * x[3]) / p["M"]]

    x, found = np.zeros(4), []
    for u in inputs:
        found.append(x[3])
        step = solve_ivp(
            rates, (0.0, sampling), x, "LSODA", args=(float(u),), rtol=1e-8, atol=1e-10, max_step=sampling / 4
        )
        x = step.y[:, -1]
    return np.array(found)
