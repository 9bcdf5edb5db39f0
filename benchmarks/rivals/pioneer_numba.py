"""jaxid's Pioneer rollout as scalar loops in numba: the simulator that SciPy's solvers drive.

The same integrator as `jaxid.simulate` with `Sticking()` friction: per sub-step the friction torques that bring every
rubbing speed to rest, limited by the mean Coulomb level over the step (two sweeps of projected Gauss-Seidel), then one
Runge-Kutta 4 step with those torques held. Symbols as in Innocenti et al.; row and unit conventions as in jaxid.
"""

import numpy as np
from numba import njit

from .pioneer_problem import BETA_SPREAD, FREE, SAMPLING, SIGMA, STATE_SCALE, SUBSTEPS, FitProblem

_TINY = 1e-30
_SWEEPS = 2


def constants(numbers: dict[str, float], free: np.ndarray) -> np.ndarray:
    """Products of the parameters that stay the same through a rollout, [18]."""
    p = {**numbers, **dict(zip(FREE, free, strict=True))}
    wheels = 2 * (p["m"] + p["Ir"] / p["R"] ** 2)
    return np.array(
        [
            p["m1"] + p["Ir1"] / p["R1"] ** 2,  # rolling mass of the caster
            p["Ip1"] / p["d"] ** 2,  # its swivelling mass
            p["M"] + wheels,
            p["M"] * (p["xm"] ** 2 + p["ym"] ** 2) + p["I0"] + 2 * p["Ip"] + wheels * p["L"] ** 2,
            p["M"] * p["xm"],
            p["M"] * p["ym"],
            p["l1"],
            p["d"],
            1 / p["R"],
            p["L"] / p["R"],
            p["tr"] * p["mu"] * p["KT"] / p["Ra"],
            p["KE"] * p["tr"],
            p["Cv"],
            p["Cv1"],
            p["Cs"] + p["tr"] * p["mu"] * p["tau_fr"],
            p["Cs1"],
        ]
    )


@njit
def _inertia(s, c, k):
    """Inverse of J as (i11, i12, i22)."""
    rolling, swivelling, l1 = k[0], k[1], k[6]
    j11 = k[2] + rolling * c * c + swivelling * s * s
    j12 = k[4] + (swivelling - rolling) * l1 * (s * c)
    j22 = k[3] + l1 * l1 * (rolling * s * s + swivelling * c * c)
    scale = 1.0 / (j11 * j22 - j12 * j12)
    return j22 * scale, -j12 * scale, j11 * scale


@njit
def _rates(beta, eta1, eta2, volt2, volt3, dry2, dry3, dry1, k):
    """Time derivatives of (beta, eta1, eta2) with the dry-friction torques given."""
    s, c = np.sin(beta), np.cos(beta)
    i11, i12, i22 = _inertia(s, c, k)
    l1, d, b1, b2 = k[6], k[7], k[8], k[9]
    caster1, caster2 = -s / d, -(d + l1 * c) / d
    spin2, spin3 = b1 * eta1 + b2 * eta2, b1 * eta1 - b2 * eta2
    turn = caster1 * eta1 + caster2 * eta2
    torque2 = k[10] * (volt2 - k[11] * spin2) - k[12] * spin2 - dry2
    torque3 = k[10] * (volt3 - k[11] * spin3) - k[12] * spin3 - dry3
    torque1 = -k[13] * turn - dry1
    across = k[0] * turn * (s * eta1 + c * l1 * eta2)
    along = k[1] * turn * (c * eta1 - s * l1 * eta2)
    lever = k[5] * eta2
    force = b1 * (torque2 + torque3) + caster1 * torque1 - (s * along - c * across - lever * eta2)
    moment = b2 * (torque2 - torque3) + caster2 * torque1 - (l1 * (s * across + c * along) + lever * eta1)
    return turn, i11 * force + i12 * moment, i12 * force + i22 * moment


@njit
def _limited(end, start, torque, own, level, h):
    """Change of an axis' torque towards what stops it, within the mean Coulomb levels over the step."""
    pull = (end - start) / h
    turned = min(max(-start / (h * max(pull + own * level, _TINY)), 0.0), 1.0)
    most = level - 2 * level * turned
    turned = min(max(start / (h * max(own * level - pull, _TINY)), 0.0), 1.0)
    least = -level + 2 * level * turned
    return min(max(end / (h * own), least), most) - torque


@njit
def _held(beta, eta1, eta2, volt2, volt3, h, k, levers, compliance, speed, slip, torque):
    """Dry-friction torques of (right wheel, left wheel, caster) to hold over a step; written into `torque`."""
    s, c = np.sin(beta), np.cos(beta)
    i11, i12, i22 = _inertia(s, c, k)
    levers[2, 0], levers[2, 1] = -s / k[7], -(k[7] + k[6] * c) / k[7]
    _, free1, free2 = _rates(beta, eta1, eta2, volt2, volt3, 0.0, 0.0, 0.0, k)
    for i in range(3):
        speed[i] = levers[i, 0] * eta1 + levers[i, 1] * eta2
        slip[i] = speed[i] + h * (levers[i, 0] * free1 + levers[i, 1] * free2)
        torque[i] = 0.0
        moved1 = i11 * levers[i, 0] + i12 * levers[i, 1]
        moved2 = i12 * levers[i, 0] + i22 * levers[i, 1]
        for j in range(3):
            compliance[j, i] = levers[j, 0] * moved1 + levers[j, 1] * moved2
    for _ in range(_SWEEPS):
        for i in range(3):
            own = compliance[i, i]
            level = k[15] if i == 2 else k[14]
            change = _limited(slip[i] + h * own * torque[i], speed[i], torque[i], own, level, h)
            torque[i] += change
            for j in range(3):
                slip[j] -= h * compliance[j, i] * change


@njit
def rollout(k, start, inputs, interval, substeps, out):
    """Speeds (eta1, eta2) at the samples, [T, 2] into `out`, from `constants` k and start (beta, eta1, eta2)."""
    beta, eta1, eta2 = start[0], start[1], start[2]
    h = interval / substeps
    levers, compliance = np.zeros((3, 2)), np.empty((3, 3))
    speed, slip, dry = np.empty(3), np.empty(3), np.empty(3)
    levers[0, 0], levers[0, 1], levers[1, 0], levers[1, 1] = k[8], k[9], k[8], -k[9]
    for t in range(len(inputs)):
        out[t, 0], out[t, 1] = eta1, eta2
        u, v = inputs[t, 0], inputs[t, 1]
        for _ in range(substeps):
            _held(beta, eta1, eta2, u, v, h, k, levers, compliance, speed, slip, dry)
            d2, d3, d1 = dry[0], dry[1], dry[2]
            p, q, r = _rates(beta, eta1, eta2, u, v, d2, d3, d1, k)
            g = 0.5 * h
            p2, q2, r2 = _rates(beta + g * p, eta1 + g * q, eta2 + g * r, u, v, d2, d3, d1, k)
            p3, q3, r3 = _rates(beta + g * p2, eta1 + g * q2, eta2 + g * r2, u, v, d2, d3, d1, k)
            p4, q4, r4 = _rates(beta + h * p3, eta1 + h * q3, eta2 + h * r3, u, v, d2, d3, d1, k)
            beta += h / 6 * (p + 2 * p2 + 2 * p3 + p4)
            eta1 += h / 6 * (q + 2 * q2 + 2 * q3 + q4)
            eta2 += h / 6 * (r + 2 * r2 + 2 * r3 + r4)


@njit
def _rollouts(k, starts, inputs, interval, substeps, out):
    for e in range(len(inputs)):
        rollout(k, starts[e], inputs[e], interval, substeps, out[e])


def simulate(problem: FitProblem, x: np.ndarray, substeps: int = SUBSTEPS) -> np.ndarray:
    """Speeds [E, T, 2] of all experiments at a point in the common units."""
    free, starts = problem.split(x)
    out = np.empty_like(problem.outputs)
    _rollouts(constants(problem.numbers, free), starts, problem.inputs, SAMPLING, substeps, out)
    return out


def residual(problem: FitProblem, x: np.ndarray) -> np.ndarray:
    """Weighted residuals of all samples and the priors, [2 E T + E]."""
    errors = (simulate(problem, x) - problem.outputs) / SIGMA
    beta = x[7::3] * (STATE_SCALE / BETA_SPREAD)
    return np.concatenate([errors.ravel(), beta])


def structured_jacobian(problem: FitProblem, x: np.ndarray, step: float = 1e-7) -> np.ndarray:
    """Forward differences in 10 instead of 31 directions: each initial state moves in all experiments at once."""
    here = residual(problem, x)
    E = problem.experiments
    jacobian = np.zeros((len(here), len(x)))
    for i in range(7):
        moved = x.copy()
        moved[i] += step
        jacobian[:, i] = (residual(problem, moved) - here) / step
    rows = problem.outputs[0].size
    for i in range(3):
        moved = x.copy()
        moved[7 + i :: 3] += step
        slope = (residual(problem, moved) - here) / step
        for e in range(E):
            jacobian[e * rows : (e + 1) * rows, 7 + 3 * e + i] = slope[e * rows : (e + 1) * rows]
            if i == 0:
                jacobian[E * rows + e, 7 + 3 * e] = slope[E * rows + e]
    return jacobian
