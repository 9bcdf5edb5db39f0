r"""Which linear equations a robot's logs give: momentum balances, integrated between samples.

Integrating the equation of motion over time needs no acceleration (Innocenti et al., eqs. 29-31). With measured speeds
v, positions rebuilt from them and inputs that are held between samples,

    P(t_k) - P(t_0) = integral of Q dt           "momentum":  P = M(q) v, Q = dP/dt along the robot's own rates
    v(t_k) - v(t_0) = integral of dv/dt dt       "speed":     equation 33, and 30 as printed

Both come from `Robot.rates` alone. The mass matrix is read off the way dry friction accelerates the robot; where that
does not tell it (no friction on some axis), P = v. In the momentum form the parameters that the papers identify enter
linearly, so it needs no start values, but measured speeds multiply the inertias; in the speed form they do not (no
errors in variables there), but the inertias enter inverted and the equations are linearised about given numbers.
"""

from collections.abc import Iterable
from functools import partial
from typing import Literal

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from ..._compile import compiled
from ..._float64 import in_float64
from ...logs import Log
from ...parameters import ParameterError
from ...robots.robot import Robot
from .log_rows import Rows, gather, measured_speeds, positions_of

Array = NDArray[np.float64]
Form = Literal["momentum", "speed"]

_SUBSTEPS = 4  # of one sample; the caster turns with time constants down to d / eta1, about one sample
_SMOOTH = np.ones(5) / 5  # moving average through which standstill is judged
_PAD = 512  # rows; so that logs of similar length share a compiled program


def _solved(A, b):
    """A⁻¹ b for a small symmetric positive definite A [n, n], by elimination written out.

    LAPACK's batched solver shares XLA's worker threads: several such calls in one program, as here for every tangent,
    can wait for one another for ever on a machine with two cores.
    """
    n = b.shape[0]
    rows = [[*A[i], b[i]] for i in range(n)]
    for k in range(n):
        for i in range(k + 1, n):
            factor = rows[i][k] / rows[k][k]
            rows[i] = [x - factor * y for x, y in zip(rows[i], rows[k], strict=True)]
    x: list = [None] * n
    for k in reversed(range(n)):
        x[k] = (rows[k][n] - sum(rows[k][j] * x[j] for j in range(k + 1, n))) / rows[k][k]
    return jnp.stack(x)


def _mass_times(robot: Robot, names: tuple[str, ...], state, inputs, p):
    """M(q) v from rates and rubbing speeds alone, or v where friction does not reach every speed.

    dry -> dv/dt is -K with K = M^-1 B^T and B = d(rubbing speeds)/d(v), so M K = B^T.
    """
    v = jnp.stack([jnp.asarray(state[name], float) for name in names])

    def with_speeds(x):
        return {**state, **dict(zip(names, x, strict=True))}

    def rubbing(x):
        return jnp.stack([jnp.asarray(s, float) for s in robot.rubbing(with_speeds(x), p)])

    def accelerations(dry):
        rates = robot.rates(state, inputs, tuple(dry), p)
        return jnp.stack([jnp.asarray(rates[name], float) for name in names])

    B = jax.jacfwd(rubbing)(v)
    K = -jax.jacfwd(accelerations)(jnp.zeros(B.shape[0]))
    return B.T @ K.T @ _solved(K @ K.T, v)


@partial(compiled, static_argnames=("robot", "names", "positions", "free", "form", "mass", "substeps", "slopes"))
def _integrals(robot, names, positions, free, form, mass, substeps, slopes, numbers, theta, rows):
    """Per sample: P, dP/dtheta; per interval: impulse, d(impulse)/dtheta; rubbing speeds; the friction axes' shares.

    With `slopes` also d(impulse)/d(speeds at the interval's start) and at its end, the directions of sliding
    [intervals, substeps, axes] and the positions at the nodes; `rows` then has those to take at its end, NaN for the
    rows' own.
    """
    dt, inputs, speeds, ahead, first, start, moved, *prescribed = rows
    p0 = {**numbers, **dict(zip(free, theta, strict=True))}
    h = dt / substeps
    zero_dry = (0.0,) * len(robot.rubbing({**dict.fromkeys(robot.states, 0.0)}, p0))

    def state_of(place, v):
        own = dict(zip(positions, place, strict=True)) | dict(zip(names, v, strict=True))
        return {name: own[name] for name in robot.states}

    def between(v, w, bend, share):
        """Speeds at a share of the interval: a parabola through both samples."""
        return v + share * (w - v) + bend * (share * (share - 1.0))

    def walk(place, row):
        """Positions at the 2 substeps + 1 nodes of one interval, by Runge-Kutta with interpolated speeds."""
        step, u, v, w, bend, is_first, own_start = row
        place = jnp.where(is_first, own_start, place)

        def moving(at, share):
            rates = robot.rates(state_of(at, between(v, w, bend, share)), tuple(u), zero_dry, p0)
            return jnp.stack([jnp.asarray(rates[name], float) for name in positions])

        def half(at, i):
            a, d = i / (2 * substeps), 1.0 / (2 * substeps)
            k1 = moving(at, a)
            k2 = moving(at + 0.25 * step * k1, a + 0.5 * d)
            k3 = moving(at + 0.25 * step * k2, a + 0.5 * d)
            k4 = moving(at + 0.5 * step * k3, a + d)
            return at + 0.5 * step * (k1 + 2 * k2 + 2 * k3 + k4) / 6, at

        end, nodes = jax.lax.scan(half, place, jnp.arange(2.0 * substeps))
        return end, jnp.concatenate([nodes, end[None]])

    def places(bends):
        if not positions:
            return jnp.zeros((len(dt), 2 * substeps + 1, 0))
        return jax.lax.scan(walk, start[0], (h, inputs, speeds, ahead, bends, first, start))[1]

    def accelerations(place, v, u):
        rates = robot.rates(state_of(place, v), tuple(u), zero_dry, p0)
        return jnp.stack([jnp.asarray(rates[name], float) for name in names])

    bends = jnp.zeros_like(speeds)
    nodes = places(bends)
    if form == "speed":
        # The input is held, so the speeds bend by what the model's acceleration changes over the interval.
        both = jax.vmap(accelerations)
        bends = 0.5 * dt[:, None] * (both(nodes[:, -1], ahead, inputs) - both(nodes[:, 0], speeds, inputs))
        bends = jnp.where(moved, bends, 0.0)
        nodes = places(bends)
    if slopes:
        nodes = jnp.where(jnp.isnan(prescribed[1]), nodes, prescribed[1])

    def momentum(state, u, p):
        if form == "speed" or not mass:
            return jnp.stack([state[name] for name in names])
        return _mass_times(robot, names, state, u, p)

    def force(state, u, dry, p):
        rates = robot.rates(state, u, dry, p)
        if form == "speed" or not mass:
            return jnp.stack([jnp.asarray(rates[name], float) for name in names])
        rates = {name: jnp.asarray(rates[name], float) for name in state}
        return jax.jvp(lambda s: momentum(s, u, p), (state,), (rates,))[1]

    def numbers_with(x):
        return {**numbers, **dict(zip(free, x, strict=True))}

    def sliding(state, signs, p):
        levels = robot.coulomb(state, p)
        return tuple(jnp.where(s > 0, f, b) * s for s, (b, f) in zip(signs, levels, strict=True))

    def interval(places, u, v, w, bend, step, *prescribed):
        u = tuple(u)

        def rub(j):
            state = state_of(places[2 * j], between(v, w, bend, j / substeps))
            return jnp.stack([jnp.zeros(()), *robot.rubbing(state, p0)])[1:]

        edges = jax.vmap(rub)(jnp.arange(substeps + 1))
        # Mean of sgn over a speed that runs linearly from one edge to the next, through zero or not.
        a, b = edges[:-1], edges[1:]
        signs = (a + b) / jnp.maximum(jnp.abs(a) + jnp.abs(b), 1e-300)
        signs = jnp.where(jnp.isnan(prescribed[0]), signs, prescribed[0]) if slopes else signs
        shares = (2 * jnp.arange(substeps) + 1) / (2 * substeps)

        def impulse(x, v=v, w=w):
            p = numbers_with(x)

            def middle(place, share, sign):
                state = state_of(place, between(v, w, bend, share))
                return force(state, u, sliding(state, tuple(sign), p), p)

            return step * jnp.sum(jax.vmap(middle)(places[1::2], shares, signs), axis=0)

        here = state_of(places[0], v)
        both = jax.jacfwd(lambda d: force(here, u, tuple(d), p0))(jnp.zeros(len(zero_dry)))
        levels = jnp.array([0.0, *(0.5 * (b + f) for b, f in robot.coulomb(here, p0))])[1:]
        # What an error of the speeds at either end does to the impulse; needed where that error is to be filtered out.
        of_speeds = jax.jacfwd(lambda v, w: impulse(theta, v, w), argnums=(0, 1))(v, w) if slopes else ()
        directions = (signs, places) if slopes else ()
        return (
            momentum(here, u, p0),
            jax.jacfwd(lambda x: momentum(here, u, numbers_with(x)))(theta),
            impulse(theta),
            jax.jacfwd(impulse)(theta),
            edges[0],
            jnp.abs(both) * levels,
            *of_speeds,
            *directions,
        )

    return jax.vmap(interval)(nodes, inputs, speeds, ahead, bends, h, *prescribed)


@partial(compiled, static_argnames=("robot", "names"))
def _rubbing_slopes(robot, names, numbers):
    """d(rubbing speeds)/d(measured speeds) [axes, nv] somewhere in motion."""
    state = robot.initial_state() | dict.fromkeys(names, 0.1)

    def rubbing(x):
        return jnp.stack(
            [jnp.asarray(s, float) for s in robot.rubbing(state | dict(zip(names, x, strict=True)), numbers)]
        )

    return jax.jacfwd(rubbing)(jnp.full(len(names), 0.1))


def _has_mass_matrix(robot: Robot, names: tuple[str, ...]) -> bool:
    """Whether dry friction acts on every measured speed, so that the mass matrix can be read off."""
    p = robot.parameters.numbers
    if len(robot.rubbing(robot.initial_state(), p)) < len(names):
        return False
    slopes = _rubbing_slopes(robot.structure, names, p)
    return bool(np.linalg.matrix_rank(np.asarray(slopes)) == len(names))


# -- equations ---------------------------------------------------------------------------------------------------------
def noise_of(values: Array) -> float:
    """Standard deviation of the white noise on a smooth sampled signal [n], from its third differences (robust)."""
    third = np.diff(values, n=3)
    if not len(third):
        return 0.0
    return float(1.4826 * np.median(np.abs(third - np.median(third))) / np.sqrt(20.0))


def still_at(speeds: Array, log: NDArray[np.int64]) -> NDArray[np.bool_]:
    """[N, axes]: the rubbing speed here is not told from zero."""
    still = np.zeros(speeds.shape, bool)
    for number in np.unique(log):
        rows = log == number
        for axis in range(speeds.shape[1]):
            own = speeds[rows, axis]
            padded = np.pad(own, len(_SMOOTH) // 2, mode="edge")
            smooth = np.convolve(padded, _SMOOTH, mode="valid")
            limit = 3.0 * noise_of(own) / np.sqrt(len(_SMOOTH)) + 1e-3 * np.quantile(np.abs(own), 0.95)
            # Either view may show the standstill: the smoothed one misses a stop of one sample, the raw one is noisy.
            still[rows, axis] = (np.abs(smooth) <= limit) | (np.abs(own) <= 1e-3 * np.quantile(np.abs(own), 0.95))
    return still


def axes_that_matter(shares: Array) -> NDArray[np.bool_]:
    """[equations, axes] from the friction's shares [N, equations, axes]: a tenth of the largest, or more."""
    share = np.median(shares, axis=0)
    most = np.max(share, axis=1, initial=0.0)
    return np.asarray(share >= 0.1 * np.maximum(most, 1e-300)[:, None])


def evaluate(
    robot: Robot,
    rows: Rows,
    names: tuple[str, ...],
    form: Form,
    theta: Array,
    sliding: Array | None = None,
    places: Array | None = None,
) -> list[Array]:
    """`_integrals` of the rows, which are padded so that logs of similar length share a compiled program.

    With `sliding`, directions of sliding to take (NaN: the rows' own), there are slopes, these directions and the positions
    at the nodes as well; with `places` those positions are taken.
    """
    N, positions = len(rows.dt), positions_of(robot, names)
    arrays = (rows.dt, rows.inputs, rows.speeds, rows.ahead, rows.first, rows.start, rows.moved)
    slopes = sliding is not None
    if sliding is not None:
        axes = len(robot.rubbing(robot.initial_state(), robot.parameters.numbers))
        places = np.array(np.nan) if places is None else places
        arrays += (
            np.broadcast_to(sliding, (N, _SUBSTEPS, axes)),
            np.broadcast_to(places, (N, 2 * _SUBSTEPS + 1, len(positions))),
        )
    arrays = tuple(np.concatenate([x, np.repeat(x[-1:], -N % _PAD, axis=0)]) for x in arrays)
    free, numbers = robot.parameters.free_names, robot.parameters.numbers
    mass = _has_mass_matrix(robot, names)
    results = _integrals(robot.structure, names, positions, free, form, mass, _SUBSTEPS, slopes, numbers, theta, arrays)
    return [np.asarray(x)[:N] for x in results]


@in_float64
def check_linear(robot: Robot, logs: Iterable[Log]) -> None:
    """Raise `ParameterError` naming free parameters in which, together, the robot's balances are not linear."""
    names = measured_speeds(robot)
    rows = gather(robot, logs, names)
    if not rows.moved.any():
        return  # nothing but noise: there are no balances to judge
    numbers, free = robot.parameters.numbers, robot.parameters.free_names
    theta = np.array([numbers[name] for name in free], dtype=float)
    elsewhere = np.where(theta == 0, 0.1, theta * (1.1 + 0.05 * np.arange(len(theta))))
    here, there = (evaluate(robot, rows, names, "momentum", at) for at in (theta, elsewhere))
    slopes = (1, 3)  # of momentum and of impulse, in `_integrals`
    size = np.max([np.max(np.abs(here[j]), axis=(0, 1)) for j in slopes], axis=0)
    change = np.max([np.max(np.abs(there[j] - here[j]), axis=(0, 1)) for j in slopes], axis=0)
    # A column far below the others' effect is rounding and says nothing about linearity.
    effect = size * np.abs(elsewhere)
    change = change / np.maximum(size, 1e-6 * max(effect.max(initial=0.0), 1e-300) / np.abs(elsewhere))
    bent = [name for name, moved in zip(free, change, strict=True) if not moved < 1e-6]
    if bent:
        raise ParameterError(
            f"the equations of motion of {robot.name!r} are not linear in {', '.join(bent)}, freed together; fix what "
            "makes them so (free=False: lengths, gains, one factor of a product) or use output error."
        )
