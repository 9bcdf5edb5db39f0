"""Long rollouts with their sensitivities, a stretch of time after the other, in memory that does not grow with their length.

Few logs leave most lanes of the processor empty. Their segments fill them: once the states at which segments begin are
known, which takes a rollout without sensitivities, each has its own sensitivities by what it begins with and by the
parameters, and the chain rule joins them.
"""

from collections.abc import Iterator
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from ..kernel.call import System
from ..kernel.direct import outputs, tangents
from ..kernel.groups import grouped, ungrouped
from ..kernel.machine import lanes

Array = Any
_SAMPLES, _FEWEST = 1024, 16
"""Of a segment at most, and at least."""
_NUMBERS = 4_000_000
"""Numbers of the sensitivities at a time."""
_MOST_SYSTEMS = 64


class Rollouts(NamedTuple):
    """What E rollouts start from and see; see `kernel.call.Run`. Inputs are held."""

    shares: Float[Array, "n L"]
    p: Float[Array, "E P"]
    x: Float[Array, "E S"]
    u: Float[Array, "E T U"]
    dt: Float[Array, "E T"]
    fixed: Float[Array, "E T D"]


class Segment(NamedTuple):
    """Outputs of all rollouts at the samples `part`, and their derivatives in K directions."""

    part: slice
    y: Float[Array, "E m Y"]
    dy: Float[Array, "E m Y K"]


@lru_cache(_MOST_SYSTEMS)
def with_states(system: System) -> System:
    """The system whose outputs are its states and then its outputs."""

    def seen(p: Any, x: Any, u: Any):
        return (*x, *system.output(p, x, u))

    return system.showing(seen, system.sizes[1] + system.outputs, "states and outputs")


def in_segments(
    system: System, moving: tuple[int, ...], run: Rollouts, dp: Float[Array, "E K n"], dx: Float[Array, "E K S"]
) -> Iterator[Segment]:
    """The rollouts from beginning to end, with derivatives in K directions `dp` of the parameters `moving` and `dx` of the
    initial states. Raises `Untranslated`."""
    whole, (E, T), S = with_states(system), run.dt.shape, run.x.shape[1]
    beside = max(1, lanes() // E)
    K = dp.shape[1] + S
    size = E * beside + -E * beside % lanes()
    samples = int(np.clip(_NUMBERS // (size * K * whole.outputs), _FEWEST, _SAMPLES))
    x, sensitivity = run.x, np.swapaxes(dx, 1, 2)  # [E, S, K]
    for first in range(0, T, beside * samples):
        # Each segment sees the sample with which the next one begins.
        begins = [at for at in range(first, min(first + beside * samples, T), samples)]
        at = [np.minimum(np.arange(begin, begin + samples + 1), T - 1) for begin in begins]
        starts, seen = [], []
        for own in at:
            starts.append(x)
            seen.append(ungrouped(outputs(whole, _lanes(run, [own], x)), E))
            x = seen[-1][:, -1, :S]
        if len(begins) == 1:
            turned = np.swapaxes(sensitivity, 1, 2)
            slopes = tangents(whole, moving, _lanes(run, at, x=starts[0]), grouped(dp), grouped(turned))
            each = [ungrouped(slopes, E)]
        else:
            each = _joined(whole, moving, run, at, starts, dp, sensitivity)
        for begin, y, dy in zip(begins, seen, each, strict=True):
            part = slice(begin, min(begin + samples, T))
            m = part.stop - begin
            yield Segment(part, y[:, :m, S:], dy[:, :m, S:])
            sensitivity = dy[:, -1, :S]


def _lanes(run: Rollouts, at: list[Array], x: Float[Array, "e S"]):
    """What the machine code reads of segments at samples `at`, those of the first rollout first, that begin with `x`."""
    E, here = len(run.p), np.stack(at)

    def cut(values: Array) -> Array:
        return grouped(values[:, here].reshape(E * len(at), *here.shape[1:], *values.shape[2:]))

    p = np.repeat(run.p, len(at), axis=0)
    return run.shares, grouped(p), grouped(x), cut(run.u[:, :, None]), cut(run.dt), cut(run.fixed)


def _joined(
    whole: System,
    moving: tuple[int, ...],
    run: Rollouts,
    at: list[Array],
    starts: list[Array],
    dp: Float[Array, "E K n"],
    sensitivity: Float[Array, "E S K"],
) -> Iterator[Float[Array, "E m Y K"]]:
    """Derivatives of segments that run side by side, one after the other, from that of the state with which the first
    begins."""
    E, S, B = len(run.p), run.x.shape[1], len(at)
    driven = np.flatnonzero(dp.any(axis=(0, 2)))
    m = len(driven)
    by_p, by_x = np.zeros((E * B, m + S, dp.shape[2])), np.zeros((E * B, m + S, S))
    by_p[:, :m], by_x[:, m:] = np.repeat(dp[:, driven], B, axis=0), np.eye(S)
    x = np.stack(starts, axis=1).reshape(E * B, S)
    slopes = ungrouped(tangents(whole, moving, _lanes(run, at, x), grouped(by_p), grouped(by_x)), E * B)
    slopes = slopes.reshape(E, B, *slopes.shape[1:])
    for k in range(B):
        own = slopes[:, k]
        dy = np.matmul(own[..., m:], sensitivity[:, None])
        dy[..., driven] += own[..., :m]
        yield dy
        sensitivity = dy[:, -1, :S]
