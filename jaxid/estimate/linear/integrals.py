"""Integrals of a robot's balance over every interval of the logs, with their slopes: machine code over blocks of rows."""

import warnings
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Literal, NamedTuple

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from ...kernel.symbolic import Untranslated
from ...robots.robot import Robot
from .balance import Balance, balance, rubbing_slopes
from .integrals_in_xla import integrals_in_xla, rubbing_slopes_in_xla
from .log_rows import Rows, positions_of
from .walks import NODES, SUBSTEPS, Walk, at, walks

Array = NDArray[np.float64]
Form = Literal["momentum", "speed"]
_BLOCK = 16_384
"""Rows at a time, which bounds the memory that their nodes take."""
_PAD = 512
"""Rows, so that logs of similar length share a program of XLA's."""


class SlowEquations(UserWarning):
    """A model whose functions have no translation to machine code has its linear equations worked out by XLA."""


class Asked(NamedTuple):
    """Which balances: measured speeds, the other states, free parameters, form, and whether there is a mass matrix."""

    names: tuple[str, ...]
    positions: tuple[str, ...]
    free: tuple[str, ...]
    form: Form
    mass: bool


def integrals(
    robot: Robot,
    asked: Asked,
    numbers: Mapping[str, float],
    rows: Rows,
    sliding: Array | None = None,
    places: Array | None = None,
    walk: Walk | None = None,
) -> tuple[Array, ...]:
    """Per sample: P [N, nv], dP/dtheta [N, nv, free]; per interval: impulse [N, nv], d(impulse)/dtheta [N, nv, free]; rubbing
    speeds [N, axes]; the friction axes' shares [N, nv, axes].

    With `sliding`, directions of sliding to take (NaN: the rows' own), also d(impulse)/d(speeds at the interval's start) and
    at its end [N, nv, nv], these directions [N, substeps, axes] and the positions at the nodes [N, nodes, nk]; with `places`
    those positions are taken. `robot` is the structure that `numbers` belong to; `walk`: one of `walked`, where the rows' is
    known.
    """
    try:
        code = _code(robot, asked, numbers)
    except Untranslated as missing:
        said = f"the linear equations of {robot.name!r} have no machine code ({missing}); XLA works them out, slower"
        warnings.warn(said, SlowEquations, stacklevel=2)
        return _in_xla(robot, asked, numbers, rows, sliding, places)
    # Numbers far from the truth may run away; what is not finite is left out by who asked.
    with np.errstate(all="ignore"):
        p = np.array([*numbers.values()], dtype=float)
        (walk,) = walks(code, p, [rows], asked.form == "speed") if walk is None else (walk,)
        found = _Integrals(code, asked, p, rows, walk).all(sliding, places)
    for x in found:
        x[~np.isfinite(x)] = np.nan
    return found


def _code(robot: Robot, asked: Asked, numbers: Mapping[str, float]) -> Balance:
    # P and dP of the speed form are the speeds themselves: no mass matrix enters there.
    mass = asked.mass and asked.form == "momentum"
    return balance(robot, asked.names, asked.positions, tuple(numbers), asked.free, mass, SUBSTEPS)


def walked(robot: Robot, asked: Asked, numbers: Mapping[str, float], each: Sequence[Rows]) -> list[Walk] | None:
    """The walk of each set of rows, all side by side; None where there is no machine code."""
    try:
        code = _code(robot, asked, numbers)
    except Untranslated:
        return None
    with np.errstate(all="ignore"):
        return walks(code, np.array([*numbers.values()], dtype=float), each, asked.form == "speed")


def has_mass_matrix(robot: Robot, names: tuple[str, ...]) -> bool:
    """Whether dry friction acts on every measured speed, so that the mass matrix can be read off."""
    numbers = robot.parameters.numbers
    return _reads_off(robot.structure, names, tuple((name, float(value)) for name, value in numbers.items()))


@lru_cache(256)
def _reads_off(robot: Robot, names: tuple[str, ...], numbers: tuple[tuple[str, float], ...]) -> bool:
    p, start = dict(numbers), robot.initial_state()
    axes = len(robot.rubbing(start, p))
    if axes < len(names):
        return False
    positions = positions_of(robot, names)
    try:
        slopes = rubbing_slopes(robot, names, positions, tuple(p))
    except Untranslated:
        found = rubbing_slopes_in_xla(robot, names, p)
    else:
        somewhere = np.array([start[name] for name in positions] + [0.1] * len(names))
        found = slopes(np.array([*p.values()], dtype=float), somewhere[None, None], np.zeros((1, 0)))
    return bool(np.linalg.matrix_rank(np.asarray(found).reshape(axes, len(names))) == len(names))


class _Integrals:
    """The integrals of `rows` at the parameters' values `p`."""

    def __init__(self, code: Balance, asked: Asked, p: Array, rows: Rows, walk: Walk):
        self.code, self.asked, self.p, self.rows, self.walk = code, asked, p, rows, walk

    def _at(self, function, *columns: Array) -> Array:
        return at(function, self.p, *columns)

    def all(self, sliding: Array | None, prescribed: Array | None) -> tuple[Array, ...]:
        N, nk = len(self.rows.dt), len(self.asked.positions)
        places, bends = self.walk
        if prescribed is not None:
            own = np.broadcast_to(prescribed, (N, NODES, nk))
            places = np.where(np.isnan(own), places, own)
        if sliding is not None:
            sliding = np.broadcast_to(sliding, (N, SUBSTEPS, self.code.axes))
        results: list[Array] = []
        for part in _blocks(N):
            found = self._block(part, places, bends, sliding)
            results = results or [np.empty((N, *x.shape[1:])) for x in found]
            for whole, x in zip(results, found, strict=True):
                whole[part] = x
        return tuple(results) if sliding is None else (*results, places)

    def _block(self, part: slice, places: Array, bends: Array, sliding: Array | None) -> tuple[Array, ...]:
        rows, code, nv, n = self.rows, self.code, len(self.asked.names), len(self.asked.free)
        place, bend, v, w = places[part], bends[part, None], rows.speeds[part, None], rows.ahead[part, None]
        u, h, still = rows.inputs[part], rows.dt[part, None] / SUBSTEPS, np.zeros(self.code.axes)

        def between(shares: Array) -> Array:
            """Speeds [rows, shares, nv]: a parabola through both samples."""
            share = shares[:, None]
            return v + share * (w - v) + bend * (share * (share - 1.0))

        edges = self._at(code.rubbing, place[:, ::2], between(np.arange(SUBSTEPS + 1) / SUBSTEPS))
        # Mean of sgn over a speed that runs linearly from one edge to the next, through zero or not.
        a, b = edges[:, :-1], edges[:, 1:]
        signs = (a + b) / np.maximum(np.abs(a) + np.abs(b), 1e-300)
        if sliding is not None:
            signs = np.where(np.isnan(sliding[part]), signs, sliding[part])
        shares = (2 * np.arange(SUBSTEPS) + 1) / (2 * SUBSTEPS)
        found = self._at(code.force, place[:, 1::2], between(shares), u[:, None], still, signs)
        force, by_theta, by_speed = np.split(found, [nv, nv * (1 + n)], axis=-1)
        sample = self._at(code.sample, place[:, 0], v[:, 0], u, still)
        P, dP, friction = np.split(sample, [nv, nv * (1 + n)], axis=-1)
        own = (
            P,
            dP.reshape(len(P), nv, n),
            h * force.sum(axis=1),
            h[:, :, None] * by_theta.sum(axis=1).reshape(len(P), nv, n),
            edges[:, 0],
            friction.reshape(len(P), nv, self.code.axes),
        )
        if sliding is None:
            return own
        by_speed = by_speed.reshape(*by_speed.shape[:2], nv, nv)
        # What an error of the speeds at either end does to the impulse; needed where that error is to be filtered out.
        at_start, at_end = (
            h[:, :, None] * np.einsum("j,rjab->rab", share, by_speed) for share in (1.0 - shares, shares)
        )
        return (*own, at_start, at_end, signs)


def _blocks(N: int) -> Iterator[slice]:
    return (slice(first, first + _BLOCK) for first in range(0, max(N, 1), _BLOCK))


def _in_xla(
    robot: Robot,
    asked: Asked,
    numbers: Mapping[str, float],
    rows: Rows,
    sliding: Array | None,
    places: Array | None,
) -> tuple[Array, ...]:
    N, slopes = len(rows.dt), sliding is not None
    arrays = (rows.dt, rows.inputs, rows.speeds, rows.ahead, rows.first, rows.start, rows.moved)
    if sliding is not None:
        axes = len(robot.rubbing(robot.initial_state(), dict(numbers)))
        places = np.array(np.nan) if places is None else places
        arrays += (
            np.broadcast_to(sliding, (N, SUBSTEPS, axes)),
            np.broadcast_to(places, (N, NODES, len(asked.positions))),
        )
    arrays = tuple(np.concatenate([x, np.repeat(x[-1:], -N % _PAD, axis=0)]) for x in arrays)
    theta = jnp.array([numbers[name] for name in asked.free], dtype=float)
    results = integrals_in_xla(robot, *asked, SUBSTEPS, slopes, dict(numbers), theta, arrays)
    return tuple(np.array(x)[:N] for x in results)  # a copy, for whoever works in place
