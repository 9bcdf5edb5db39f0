"""Steps from one linearisation, and the best of those that have been simulated.

All candidates of a round move the parameters equally far, along the straight line or along the curve of `chart`. They differ
in the share of the way on which each experiment's own unknowns go besides: what a share costs an experiment is that
experiment's affair alone, so that every experiment takes its best share, whatever the others take. A caster that is about
to flip, or a wheel about to stick, in one run stops that run's initial state and nothing else.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ..._arrays import AnyArray as Array
from ..._arrays import namespace, surely_not
from .arrow import Eliminated
from .chart import Chart
from .problem import Apart, Triangle, Unknowns

_SHARES = (1.0, 0.3, 0.1, 0.01)
"""Of an experiment's usual share of its own way, the shares that are tried."""
_PATHS = 2
_FAR = 0.5
"""Length of the parameters' step, in units of the chart, from which the curve is another way than the straight line."""


class Steps(NamedTuple):
    """Candidates [c], c = 2 paths x k shares, path by path, and what is known of their costs.

    `shared` [n]: the parameters' step in units of the chart, of the given `length`; `shares` [k, E]; `asked` [c]: whose costs
    are to be worked out; `known`: the costs by experiment, infinite where they are not.
    """

    shared: Float[Array, " n"]
    length: Float[Array, ""]
    shares: Float[Array, "k E"]
    candidates: Unknowns
    asked: Bool[Array, " c"]
    known: Apart


class Best(NamedTuple):
    """The best of some steps: where it leads, its cost, and that of every experiment (`own`).

    `shares` [E]: those of the experiments' own ways; `which` of those tried they were (0: the longest); `promise`: the drop of
    the cost that the linearisation has for it.
    """

    there: Unknowns
    cost: Float[Array, ""]
    own: Float[Array, " E"]
    shares: Float[Array, " E"]
    which: Int[Array, " E"]
    promise: Float[Array, ""]


def no_steps(here: Unknowns) -> Steps:
    """In place of steps where none is asked for."""
    nothing = np.zeros(0)
    return Steps(nothing, nothing, nothing, here, nothing, Apart(nothing, nothing))


def several(own: int) -> int:
    """How many shares there are for so many own unknowns of an experiment."""
    return len(_SHARES) if own else 1


def steps_of(
    chart: Chart,
    system: Eliminated,
    shared: Float[Array, " n"],
    usual: Float[Array, " E"],
    first: Bool[Array, ""] | bool,
) -> Steps:
    """The steps whose parameters go by `shared`; at `first` the `usual` shares alone are asked for."""
    xp = namespace(system.pull)
    E, s = chart.here.states.shape
    k = several(s)
    shares = xp.array(_SHARES[:k])[:, None] * usual
    step = xp.broadcast_to(shared, (k, len(shared)))
    own = system.own_step(step, shares[:, :, None])
    length = xp.sqrt((shared**2).sum())
    far = length > _FAR
    straight = chart.straight(step, own)
    curved = straight if surely_not(far) else chart.curved(step, own)
    early = xp.where(first, xp.arange(k) == 0, True)
    return Steps(
        shared,
        length,
        shares,
        Unknowns(*(xp.concatenate(both) for both in zip(straight, curved, strict=True))),
        xp.concatenate([early, early & far]),
        Apart(xp.full((_PATHS * k, E), xp.inf), xp.full(_PATHS * k, xp.inf)),
    )


def others(steps: Steps) -> Steps:
    """The same once the usual shares' costs are known: the other shares are asked for."""
    xp = namespace(steps.shared)
    k = len(steps.shares)
    path = xp.repeat(steps.asked.reshape(_PATHS, k)[:, 0], k)
    return steps._replace(asked=path & ~steps.asked)


def simulated(steps: Steps, found: Apart) -> Steps:
    """The steps once the costs of those that were asked for are known."""
    xp = namespace(steps.shared)
    own = xp.where(steps.asked[:, None] & xp.isfinite(found.own), found.own, steps.known.own)
    return steps._replace(known=Apart(own, xp.where(steps.asked, found.shared, steps.known.shared)))


def best_of(steps: Steps, scaled: Triangle, system: Eliminated) -> Best:
    """The better path, every experiment with its best share."""
    xp = namespace(steps.shared)
    k, E = steps.shares.shape
    own = steps.known.own.reshape(_PATHS, k, E)
    totals = own.min(axis=1).sum(axis=1) + steps.known.shared.reshape(_PATHS, k).min(axis=1)
    path = xp.argmin(totals)
    which, e = xp.argmin(own, axis=1)[path], xp.arange(E)
    z, states = (leaf.reshape(_PATHS, k, *leaf.shape[1:]) for leaf in steps.candidates)
    shares = steps.shares[which, e]
    return Best(
        Unknowns(z[path, 0], states[path, which, e]),
        totals[path],
        own.min(axis=1)[path],
        shares,
        which,
        promised(scaled, steps.shared, system.own_step(steps.shared, shares[:, None])),
    )


def promised(scaled: Triangle, shared: Float[Array, " n"], own: Float[Array, "E s"]) -> Float[Array, ""]:
    """Drop of the cost (half chi-squared) that the linearisation has for a step."""
    by_own = (scaled.local * own[:, None, :]).sum(axis=2) + scaled.crossed @ shared
    by_shared = scaled.shared @ shared
    return -(
        (by_own * (scaled.residual_local + 0.5 * by_own)).sum()
        + (by_shared * (scaled.residual_shared + 0.5 * by_shared)).sum()
    )
