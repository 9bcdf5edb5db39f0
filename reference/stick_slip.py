"""Event-accurate integration of mechanical systems with Coulomb friction at several rubbing axes.

The system is x' = a(t, x, u) - G(x) f, where the n_v entries of x from `first` on are speeds v, the rubbing speeds
are s = B(x) v, and f are the dry friction forces at the axes. Each axis is in one of three modes: sliding forwards (s
> 0, f = level+), sliding backwards (s < 0, f = -level-) or sticking (s = 0, f is whatever keeps it so, as long as
-level- <= f <= level+). Between events the mode is fixed and the smooth equations are integrated by the embedded
Runge-Kutta pair of Dormand and Prince (1980), order 5(4), with step control. Zero crossings of sliding speeds and
break-away of sticking axes are located by bisection on the length of the last step (so with the accuracy of the
method, not of an interpolant). At an event the new mode is the consistent one among all 3^k of the k axes at rest;
the acceleration it gives is unique (it minimises a strictly convex function), the split of the forces need not be:
with more axes than speeds the sticking forces have a one-dimensional family, and the axes stick as long as that
family meets the box of the levels.
"""

import numpy as np
from numba import float64, int64, njit, types, void

from reference.compiled import compiled

VECTOR, MATRIX = float64[::1], float64[:, ::1]
# dynamics(t, x, u, p, e, xdot, G, B, bias, level): fills x' without dry friction, dx'/d(-f) (n x axes),
# B (axes x speeds), B' v (axes) and the levels for forward and backward sliding (2 x axes)
DYNAMICS = void(float64, VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, MATRIX, MATRIX, VECTOR, MATRIX)

FRICTIONLESS = 2  # mode of an axis whose levels are zero; the others are +1, -1 (sliding) and 0 (sticking)
SPEED_ZERO = 1e-9  # rubbing speeds below this are at rest when an event is resolved
SPEED_CROSSED = 1e-12  # a sliding speed this far on the wrong side has crossed zero
MARGIN = 1e-11  # relative tolerance of the break-away level

_C = np.array([0.0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0, 1.0])
_A = np.array(
    [
        [0, 0, 0, 0, 0, 0],
        [1 / 5, 0, 0, 0, 0, 0],
        [3 / 40, 9 / 40, 0, 0, 0, 0],
        [44 / 45, -56 / 15, 32 / 9, 0, 0, 0],
        [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0, 0],
        [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656, 0],
        [35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
    ]
)
_E = np.array([71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40])


@njit
def _copy(source, target):
    """`target[:] = source`, which numba compiles with all that words its message about unequal shapes: for seconds."""
    for i in range(target.size):
        target[i] = source[i]


@njit
def _solve(matrix, rhs, n, solution, null):
    """Gaussian elimination with full pivoting: a particular solution, one null vector if any, and the rank."""
    a = matrix[:n, :n].copy()
    b = rhs[:n].copy()
    order = np.arange(n)
    scale = 0.0
    for i in range(n):
        scale = max(scale, a[i, i])
    rank = n
    for k in range(n):
        row, column, largest = k, k, 0.0
        for i in range(k, n):
            for j in range(k, n):
                if abs(a[i, j]) > largest:
                    row, column, largest = i, j, abs(a[i, j])
        if largest <= 1e-10 * scale:
            rank = k
            break
        for j in range(n):
            a[k, j], a[row, j] = a[row, j], a[k, j]
        b[k], b[row] = b[row], b[k]
        for i in range(n):
            a[i, k], a[i, column] = a[i, column], a[i, k]
        order[k], order[column] = order[column], order[k]
        for i in range(k + 1, n):
            factor = a[i, k] / a[k, k]
            for j in range(k, n):
                a[i, j] -= factor * a[k, j]
            b[i] -= factor * b[k]
    for i in range(n):
        solution[i] = null[i] = 0.0
    if rank < n:
        null[order[rank]] = 1.0
    for k in range(rank - 1, -1, -1):
        x = b[k]
        z = -a[k, rank] if rank < n else 0.0
        for j in range(k + 1, rank):
            x -= a[k, j] * solution[order[j]]
            z -= a[k, j] * null[order[j]]
        solution[order[k]] = x / a[k, k]
        if rank < n:
            null[order[k]] = z / a[k, k]
    return rank


@njit
def _forces(mode, xdot, G, B, bias, level, first, f, sdot):
    """Friction forces f and rubbing accelerations of a mode.

    Returns the sticking axes' smallest distance from break-away (relative) and whether they hold all speeds.
    """
    n_axes, n_v = B.shape
    A = np.zeros((n_axes, n_axes))
    free = bias.copy()
    stuck = np.empty(n_axes, np.int64)
    n = 0
    for i in range(n_axes):
        for k in range(n_v):
            free[i] += B[i, k] * xdot[first + k]
            for j in range(n_axes):
                A[i, j] += B[i, k] * G[first + k, j]
        f[i] = 0.0
        if mode[i] == 1:
            f[i] = level[0, i]
        elif mode[i] == -1:
            f[i] = -level[1, i]
        elif mode[i] == 0:
            stuck[n] = i
            n += 1
    margin, held = 1.0, False
    if n > 0:
        matrix, rhs = np.empty((n, n)), np.empty(n)
        for i in range(n):
            rhs[i] = free[stuck[i]]
            for j in range(n_axes):
                rhs[i] -= A[stuck[i], j] * f[j]
            for j in range(n):
                matrix[i, j] = A[stuck[i], stuck[j]]
        solution, null = np.empty(n), np.empty(n)
        rank = _solve(matrix, rhs, n, solution, null)
        held = rank == n_v
        if rank < n:  # move along the null vector to the middle of the interval that respects the box
            low, high = -1e300, 1e300
            for i in range(n):
                top, bottom = level[0, stuck[i]] - solution[i], -level[1, stuck[i]] - solution[i]
                if null[i] > 1e-12:
                    low, high = max(low, bottom / null[i]), min(high, top / null[i])
                elif null[i] < -1e-12:
                    low, high = max(low, top / null[i]), min(high, bottom / null[i])
            for i in range(n):
                solution[i] += 0.5 * (low + high) * null[i]
        for i in range(n):
            k = stuck[i]
            f[k] = solution[i]
            margin = min(margin, min(level[0, k] - f[k], f[k] + level[1, k]) / max(level[0, k], level[1, k]))
    for i in range(n_axes):
        sdot[i] = free[i]
        for j in range(n_axes):
            sdot[i] -= A[i, j] * f[j]
        if mode[i] == 0 and abs(sdot[i]) > 1e-7 * (abs(free[i]) + A[i, i] * level[0, i]):
            margin = -1.0  # a singular set that cannot be held at rest by any forces
    return margin, held


@njit
def _evaluate(dynamics, t, x, u, p, e, mode, first, xdot, G, B, bias, level, f, s, sdot):
    """x' in a mode, with the rubbing speeds and accelerations; returns the break-away margin."""
    dynamics(t, x, u, p, e, xdot, G, B, bias, level)
    margin, held = _forces(mode, xdot, G, B, bias, level, first, f, sdot)
    n_axes, n_v = B.shape
    for i in range(x.size):
        for j in range(n_axes):
            xdot[i] -= G[i, j] * f[j]
    if held:  # exactly, not up to rounding
        for k in range(n_v):
            xdot[first + k] = 0.0
    for i in range(n_axes):
        s[i] = 0.0
        for k in range(n_v):
            s[i] += B[i, k] * x[first + k]
    return margin


@njit
def _stop(x, mode, first, G, B, s):
    """Remove the rounding that sticking axes have left in the speeds; exactly zero if they hold all speeds."""
    n_axes, n_v = B.shape
    stuck = np.empty(n_axes, np.int64)
    n = 0
    for i in range(n_axes):
        if mode[i] == 0:
            stuck[n] = i
            n += 1
    if n == 0:
        return
    matrix, rhs, multiplier, null = np.empty((n, n)), np.empty(n), np.empty(n), np.empty(n)
    for i in range(n):
        rhs[i] = s[stuck[i]]
        for j in range(n):
            matrix[i, j] = 0.0
            for k in range(n_v):
                matrix[i, j] += B[stuck[i], k] * G[first + k, stuck[j]]
    rank = _solve(matrix, rhs, n, multiplier, null)
    change = np.zeros(n_v)
    for k in range(n_v):
        for j in range(n):
            change[k] -= G[first + k, stuck[j]] * multiplier[j]
        if rank == n_v:
            change[k] = -x[first + k]
        if abs(change[k]) > 1e-6:  # nearly parallel axes: not rounding, leave it to the next event
            return
    for k in range(n_v):
        x[first + k] += change[k]


@njit
def _resolve(dynamics, t, x, u, p, e, mode, first, xdot, G, B, bias, level, f, s, sdot):
    """Choose the consistent mode of all axes at rest; sliding axes keep the sign of their speed."""
    n_axes, n_v = B.shape
    _evaluate(dynamics, t, x, u, p, e, mode, first, xdot, G, B, bias, level, f, s, sdot)
    resting = np.empty(n_axes, np.int64)
    n = 0
    for i in range(n_axes):
        if level[0, i] <= 0.0 and level[1, i] <= 0.0:
            mode[i] = FRICTIONLESS
        elif abs(s[i]) <= SPEED_ZERO or mode[i] == 0:
            mode[i] = 0
            resting[n] = i
            n += 1
        else:
            mode[i] = 1 if s[i] > 0 else -1
    if n == 0:
        return
    _stop(x, mode, first, G, B, s)
    dynamics(t, x, u, p, e, xdot, G, B, bias, level)
    trial, best = mode.copy(), mode.copy()
    best_violation = np.inf
    for sliding in range(n + 1):  # the modes that stick most come first
        for code in range(3**n):
            rest, count = code, 0
            for i in range(n):
                trial[resting[i]] = (0, 1, -1)[rest % 3]
                count += rest % 3 != 0
                rest //= 3
            if count != sliding:
                continue
            violation = max(0.0, -_forces(trial, xdot, G, B, bias, level, first, f, sdot)[0])
            for i in range(n):
                k = resting[i]
                if trial[k] != 0:
                    inverse_mass = 0.0
                    for m in range(n_v):
                        inverse_mass += B[k, m] * G[first + m, k]
                    violation = max(violation, -trial[k] * sdot[k] / (inverse_mass * max(level[0, k], level[1, k])))
            if violation < best_violation - MARGIN:
                best_violation = violation
                _copy(trial, best)
        if best_violation <= MARGIN:
            break
    _copy(best, mode)


@njit
def _step(dynamics, t, x, h, u, p, e, mode, first, K, end, G, B, bias, level, f, s, sdot):
    """One Runge-Kutta step of length h from x, whose derivative is K[0]; returns the break-away margin at its end."""
    n = x.size
    margin = 1.0
    for stage in range(1, 7):
        for i in range(n):
            total = 0.0
            for j in range(stage):
                total += _A[stage, j] * K[j, i]
            end[i] = x[i] + h * total
        margin = _evaluate(
            dynamics, t + _C[stage] * h, end, u, p, e, mode, first, K[stage], G, B, bias, level, f, s, sdot
        )
    return margin


@njit
def _event(mode, s, margin):
    """Whether a sliding axis has crossed zero or a sticking one has broken away."""
    if margin < -2.0 * MARGIN:
        return True
    for i in range(s.size):
        if (mode[i] == 1 or mode[i] == -1) and mode[i] * s[i] < -SPEED_CROSSED:
            return True
    return False


@njit
def _dips(mode, s0, d0, s1, d1, h):
    """Whether the cubic through both ends of a step has a sliding axis touch zero and come back inside it."""
    for i in range(s0.size):
        if mode[i] == 1 or mode[i] == -1:
            a, da, b, db = mode[i] * s0[i], mode[i] * d0[i] * h, mode[i] * s1[i], mode[i] * d1[i] * h
            if da < 0.0 and db > 0.0:
                for k in range(1, 8):
                    z = k / 8
                    y = (
                        a * (1 + 2 * z) * (1 - z) ** 2
                        + da * z * (1 - z) ** 2
                        + b * z * z * (3 - 2 * z)
                        + db * z * z * (z - 1)
                    )
                    if y < 0.0:
                        return True
    return False


@compiled(
    types.Tuple((MATRIX, int64[:, ::1], int64))(
        types.FunctionType(DYNAMICS),
        VECTOR,
        VECTOR,
        MATRIX,
        VECTOR,
        VECTOR,
        int64,
        int64,
        int64,
        float64,
        float64,
        float64,
    )
)
def integrate(dynamics, x0, breaks, inputs, p, e, first, n_v, n_axes, rtol, atol, longest):
    """States at the break points `breaks` (K + 1, seconds), the input being inputs[k] from breaks[k] to breaks[k + 1].

    Returns the states (K + 1, n), the modes after each break point (K + 1, n_axes) and the number of events; -1
    events means that the integration came to a halt (hundreds of events at one instant, or a state that is not
    finite).
    """
    n = x0.size
    x, end = x0.copy(), np.empty(n)
    K = np.empty((7, n))
    G, B, bias, level = np.zeros((n, n_axes)), np.zeros((n_axes, n_v)), np.zeros(n_axes), np.zeros((2, n_axes))
    f, s, sdot, s_end, sdot_end = (
        np.empty(n_axes),
        np.empty(n_axes),
        np.empty(n_axes),
        np.empty(n_axes),
        np.empty(n_axes),
    )
    mode = np.ones(n_axes, np.int64)
    states, modes = np.empty((breaks.size, n)), np.zeros((breaks.size, n_axes), np.int64)
    events, h = 0, min(longest, 1e-3)
    _copy(x, states[0])
    for segment in range(breaks.size - 1):
        t, last = breaks[segment], breaks[segment + 1]
        u = inputs[segment]
        _resolve(dynamics, t, x, u, p, e, mode, first, K[0], G, B, bias, level, f, s, sdot)
        _copy(mode, modes[segment])
        _evaluate(dynamics, t, x, u, p, e, mode, first, K[0], G, B, bias, level, f, s, sdot)
        at_once = 0
        while t < last:
            remaining = last - t
            step = min(h, longest)
            final = step >= remaining * (1.0 - 1e-9)
            if final:
                step = remaining
            margin = _step(dynamics, t, x, step, u, p, e, mode, first, K, end, G, B, bias, level, f, s_end, sdot_end)
            error = 0.0
            for i in range(n):
                difference = 0.0
                for j in range(7):
                    difference += _E[j] * K[j, i]
                error = max(error, abs(step * difference) / (atol + rtol * max(abs(x[i]), abs(end[i]))))
                if not np.isfinite(end[i]):
                    error = 1e6
            if error > 1.0 and step > 1e-10:
                h = step * max(0.1, 0.9 * error**-0.2)
                continue
            if error >= 1e6:
                return states, modes, -1
            happened = _event(mode, s_end, margin)
            if not happened and step > 1e-7 and _dips(mode, s, sdot, s_end, sdot_end, step):
                h = 0.3 * step
                continue
            if happened and at_once < 200:
                low, high = 0.0, step
                while high - low > 1e-14 + 4e-16 * t:
                    middle = 0.5 * (low + high)
                    if middle <= low or middle >= high:
                        break
                    margin = _step(
                        dynamics, t, x, middle, u, p, e, mode, first, K, end, G, B, bias, level, f, s_end, sdot_end
                    )
                    if _event(mode, s_end, margin):
                        high = middle
                    else:
                        low = middle
                _step(dynamics, t, x, high, u, p, e, mode, first, K, end, G, B, bias, level, f, s_end, sdot_end)
                at_once = at_once + 1 if high < 1e-11 else 0
                t = last if final and high == step else t + high
                _copy(end, x)
                for i in range(n_axes):  # a crossed axis is at rest however fast it was going to cross
                    if abs(mode[i]) == 1 and mode[i] * s_end[i] < 0.0:
                        mode[i] = 0
                events += 1
                _resolve(dynamics, t, x, u, p, e, mode, first, K[0], G, B, bias, level, f, s, sdot)
            else:
                if happened and at_once >= 200:
                    return states, modes, -1
                t = last if final else t + step
                _copy(end, x)
                _stop(x, mode, first, G, B, s_end)
                if not final:
                    h = step * min(4.0, 0.9 * max(error, 1e-6) ** -0.2)
                elif error > 0.0:
                    h = max(h, min(longest, step * min(4.0, 0.9 * max(error, 1e-6) ** -0.2)))
            _evaluate(dynamics, t, x, u, p, e, mode, first, K[0], G, B, bias, level, f, s, sdot)
        _copy(x, states[segment + 1])
    _copy(mode, modes[breaks.size - 1])
    return states, modes, events
