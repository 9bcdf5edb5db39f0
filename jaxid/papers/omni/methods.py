"""The omni paper's methods 1, 2, 1+2 and 3 on arrays (Conceição et al. 2006, section 3).

Method 1: at steady speed the traction force is `B v + C`. Method 2: with the motors off the robot coasts down as
`dv/dt = -(B/M) v - C/M`. Methods 1+2: the same in W with B, C known gives J. Method 3: a hanging robot turned by a
known torque gives J.

The paper differentiates the measured speed (Euler) and fits a line. A noisy sample then stands on both sides of the
fit, with opposite signs, and the slope, hence the viscous friction, comes out too large. By default the same equations
are fitted in integrated form, where nothing is differentiated and the residual is the sensor's own noise, so that the
regression's standard errors hold; `differentiate=True` is the paper's way.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import cumulative_trapezoid

from ...estimate.result import Estimate
from .printed import AXES, COULOMB, DISC_RADIUS, GRAVITY, VISCOUS, Axis

Array = NDArray[np.float64]
Measured = ArrayLike | Sequence[float]
Run = tuple[Measured, Measured]
_VISCOUS_UNIT = {"V": "N s/m", "Vn": "N s/m", "W": "N m s"}
_COULOMB_UNIT = {"V": "N", "Vn": "N", "W": "N m"}


def _arrays(what: str, **columns: Measured) -> tuple[Array, ...]:
    """The columns as equally long finite vectors; raises `ValueError` for anything else."""
    arrays = {name: np.asarray(values, dtype=float) for name, values in columns.items()}
    sizes = {name: array.shape for name, array in arrays.items()}
    if any(array.ndim != 1 for array in arrays.values()) or len(set(sizes.values())) > 1:
        raise ValueError(f"{what} needs vectors of one length, not {sizes}; give one number for each measurement.")
    for name, array in arrays.items():
        bad = np.flatnonzero(~np.isfinite(array))
        if len(bad):
            raise ValueError(f"{what}: {name} is not a finite number at sample {bad[0]}; leave that sample out.")
    return tuple(arrays.values())


def _check_axis(axis: str) -> None:
    if axis not in AXES:
        raise ValueError(f"There is no axis {axis!r} on the omni robot; use one of {list(AXES)}.")


def _least_squares(what: str, A: Array, y: Array) -> tuple[Array, Array, float, int]:
    """Coefficients, their covariance, residual standard deviation and degrees of freedom."""
    n, k = A.shape
    if n <= k:
        raise ValueError(f"{what} has {n} measurement(s) for {k} unknowns; give at least {k + 1}.")
    scale = np.linalg.norm(A, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    Q, R = np.linalg.qr(A / scale)
    if np.min(np.abs(np.diag(R))) < 1e-9:
        raise ValueError(f"{what}: the measurements do not tell the unknowns apart; vary the speed more.")
    inverse = np.linalg.inv(R) / scale[:, None]
    coefficients = inverse @ (Q.T @ y)
    residual = y - A @ coefficients
    variance = float(residual @ residual) / (n - k)
    return coefficients, variance * inverse @ inverse.T, float(np.sqrt(variance)), n - k


def _estimate(value: float, std_error: float, unit: str, freedom: int) -> Estimate:
    half = float(scipy.stats.t.ppf(0.975, freedom)) * std_error  # few measurements: Student's t, not the normal law
    return Estimate(float(value), float(std_error), (float(value - half), float(value + half)), unit, "identified")


@dataclass(frozen=True, repr=False)
class Friction:
    """Viscous and Coulomb friction of one axis with the fit behind them.

    `covariance` [2, 2] is of (viscous, coulomb) and `freedom` the regression's degrees of freedom. `x`, `y` are the
    points that were fitted by a line, where there was one (method 1: speed and force); `residual_std` is the scatter.
    """

    method: str
    axis: Axis
    viscous: Estimate
    coulomb: Estimate
    covariance: Array
    freedom: int
    residual_std: float
    x: Array
    y: Array

    @property
    def estimates(self) -> dict[str, Estimate]:
        """Both estimates by the paper's symbols, such as `{"Bv": ..., "Cv": ...}`."""
        return {VISCOUS[self.axis]: self.viscous, COULOMB[self.axis]: self.coulomb}

    def __repr__(self) -> str:
        pairs = (f"{name} = {e.value:.4g} ± {e.std_error:.2g} {e.unit}" for name, e in self.estimates.items())
        return f"{self.method}, {self.axis}: {', '.join(pairs)}"


@dataclass(frozen=True, repr=False)
class Inertia:
    """Moment of inertia J [kg m^2], and for method 3 the torque [N m] and angular acceleration [rad/s^2] behind it.

    `without_mass` is J with the falling mass's own inertia `m_o r_m²` taken off, which the paper leaves in (eq. 21
    takes the wire's tension for the mass's weight; it is `m_o (g - r_m dW/dt)`).
    """

    method: str
    J: Estimate
    torque: float | None = None
    acceleration: Estimate | None = None
    without_mass: Estimate | None = None

    def __repr__(self) -> str:
        return f"{self.method}: J = {self.J.value:.4g} ± {self.J.std_error:.2g} {self.J.unit}"


def _friction(method: str, axis: Axis, pair: Array, covariance: Array, freedom: int, std: float, x: Array, y: Array):
    errors = np.sqrt(np.diag(covariance))
    viscous = _estimate(pair[0], errors[0], _VISCOUS_UNIT[axis], freedom)
    coulomb = _estimate(pair[1], errors[1], _COULOMB_UNIT[axis], freedom)
    return Friction(method, axis, viscous, coulomb, covariance, freedom, std, x, y)


def steady_state_friction(speeds: Measured, forces: Measured, axis: Axis = "V") -> Friction:
    """Method 1 (eqs. 13-15): the least-squares line `force = B speed + C sgn(speed)` through steady states.

    **Arguments:** `speeds` [n] m/s or rad/s, none of them zero; `forces` [n] N or N m; `axis` "V", "Vn" or "W".

    Raises `ValueError` for fewer than three points, points at rest, or a single speed.
    """
    _check_axis(axis)
    speed, force = _arrays(f"Method 1 on {axis}", speeds=speeds, forces=forces)
    if np.any(speed == 0):
        raise ValueError(f"Method 1 on {axis}: speed is zero at point {np.flatnonzero(speed == 0)[0]}; leave it out.")
    A = np.stack([speed, np.sign(speed)], axis=1)
    pair, covariance, std, freedom = _least_squares(f"Method 1 on {axis}", A, force)
    return _friction("method 1", axis, pair, covariance, freedom, std, speed, force)


def _runs(what: str, runs: Sequence[Run]) -> list[tuple[Array, Array, float]]:
    """(time from the start, speed made positive, its sign) of each coast-down."""
    out = []
    for number, (time, speed) in enumerate(runs):
        t, v = _arrays(f"{what}, run {number}", time=time, speed=speed)
        if len(t) < 4 or np.any(np.diff(t) <= 0):
            raise ValueError(f"{what}, run {number} needs four or more samples with increasing time; give more.")
        sign = 1.0 if np.mean(v) > 0 else -1.0
        out.append((t - t[0], sign * v, sign))
    if not out:
        raise ValueError(f"{what} has no runs; give at least one coast-down.")
    return out


def _stacked(runs: list[tuple[Array, Array, float]], differentiate: bool) -> tuple[Array, Array, Array]:
    """Regressors of -B/m and -C/m, the left side, a column for each run's initial speed (none if differentiated)."""
    columns, left, starts = [], [], []
    for number, (t, v, _) in enumerate(runs):
        if differentiate:
            columns.append(np.stack([v[:-1], np.ones(len(v) - 1)], axis=1))
            left.append(np.diff(v) / np.diff(t))
        else:
            columns.append(np.stack([cumulative_trapezoid(v, t, initial=0.0), t], axis=1))
            left.append(v)
        own = np.zeros((len(left[-1]), 0 if differentiate else len(runs)))
        own[:, number : number + 1] = 1.0
        starts.append(own)
    return np.concatenate(columns), np.concatenate(left), np.concatenate(starts)


def coast_down_friction(runs: Sequence[Run], mass: float, axis: Axis = "V", *, differentiate: bool = False) -> Friction:
    """Method 2 (eqs. 16-17): friction from coasting down with null traction forces.

    **Arguments:** `runs`, each `(time [n] s, speed [n] m/s)` cut to the stretch in motion without traction; `mass` M
    [kg] (for "W": J [kg m²]); `differentiate=True` for the paper's Euler differences.

    By default `v = v0 - (B/M) ∫v dt - (C/M) t` is fitted, with one v0 for each run. Raises `ValueError` for empty,
    short or unordered runs.
    """
    _check_axis(axis)
    what = f"Method 2 on {axis}"
    columns, left, starts = _stacked(_runs(what, runs), differentiate)
    found, covariance, std, freedom = _least_squares(what, np.concatenate([-columns, starts], axis=1), left)
    x, y = (columns[:, 0], left) if differentiate else (np.empty(0), np.empty(0))
    return _friction("method 2", axis, mass * found[:2], mass**2 * covariance[:2, :2], freedom, std, x, y)


def coast_down_inertia(runs: Sequence[Run], friction: Friction, *, differentiate: bool = False) -> Inertia:
    """Methods 1+2 (eq. 18): J from coasting down in W with `friction` known from method 1.

    `runs` are `(time [n] s, W [n] rad/s)`. The standard error includes that of `friction`. Raises `ValueError` as
    `coast_down_friction` does, and if `friction` is not of axis "W".
    """
    if friction.axis != "W":
        raise ValueError(f"Methods 1+2 need the friction of W, not of {friction.axis}; give method 1's result for W.")
    columns, left, starts = _stacked(_runs("Methods 1+2", runs), differentiate)

    def fit(pair: Array) -> tuple[float, float, int]:
        A = np.concatenate([-(columns @ pair)[:, None], starts], axis=1)
        found, covariance, _, freedom = _least_squares("Methods 1+2", A, left)
        return 1.0 / found[0], float(np.sqrt(covariance[0, 0])) / found[0] ** 2, freedom

    pair = np.array([friction.viscous.value, friction.coulomb.value])
    J, std_error, freedom = fit(pair)
    steps = 1e-4 * np.diag(pair)
    slope = np.array([(fit(pair + step)[0] - fit(pair - step)[0]) / (2 * step.sum()) for step in steps])
    total = float(np.sqrt(std_error**2 + slope @ friction.covariance @ slope))
    return Inertia("methods 1+2", _estimate(J, total, "kg m^2", min(freedom, friction.freedom)))


def hanging_inertia(
    time: Measured,
    theta: Measured,
    mass: float,
    *,
    gravity: float = GRAVITY,
    radius: float = DISC_RADIUS,
    differentiate: bool = False,
) -> Inertia:
    """Method 3 (eqs. 19-21): `J = m_o g r_m / (dW/dt)` of the hanging robot that a falling mass turns.

    **Arguments:** `time` [n] s and `theta` [n] rad of the free fall alone; `mass` m_o [kg]; `gravity` [m/s²] and
    `radius` r_m [m] as the paper has them. A parabola is fitted to theta; `differentiate=True` fits a line to Euler
    differences of theta, as the paper does. Raises `ValueError` for fewer than four samples or a mass not above zero.
    """
    t, angle = _arrays("Method 3", time=time, theta=theta)
    if not mass > 0:
        raise ValueError(f"Method 3 has mass = {mass} kg; give the hanging mass, above zero.")
    if differentiate:
        middle, W = 0.5 * (t[1:] + t[:-1]) - t[0], np.diff(angle) / np.diff(t)
        found, covariance, _, freedom = _least_squares("Method 3", np.stack([middle, np.ones_like(middle)], axis=1), W)
    else:
        since = t - t[0]
        A = np.stack([0.5 * since**2, since, np.ones_like(since)], axis=1)
        found, covariance, _, freedom = _least_squares("Method 3", A, angle)
    acceleration = _estimate(abs(found[0]), float(np.sqrt(covariance[0, 0])), "rad/s^2", freedom)
    torque = mass * gravity * radius
    J = torque / acceleration.value
    std_error = J * acceleration.std_error / acceleration.value
    estimate = _estimate(J, std_error, "kg m^2", freedom)
    without = _estimate(J - mass * radius**2, std_error, "kg m^2", freedom)
    return Inertia("method 3", estimate, torque, acceleration, without)
