"""The integrals of `integrals.py` as one program of XLA's, for functions of a robot that have no machine code.

The tests' reference for the machine code.
"""

from functools import partial

import jax
import jax.numpy as jnp

from ..._compile import compiled
from ...robots.robot import Robot


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
def integrals_in_xla(robot, names, positions, free, form, mass, substeps, slopes, numbers, theta, rows):
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
def rubbing_slopes_in_xla(robot, names, numbers):
    """d(rubbing speeds)/d(measured speeds) [axes, nv] somewhere in motion."""
    state = robot.initial_state() | dict.fromkeys(names, 0.1)

    def rubbing(x):
        return jnp.stack(
            [jnp.asarray(s, float) for s in robot.rubbing(state | dict(zip(names, x, strict=True)), numbers)]
        )

    return jax.jacfwd(rubbing)(jnp.full(len(names), 0.1))
