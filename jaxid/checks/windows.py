"""How a robot's speeds change over short windows: one small model, whatever the robot.

Over windows of a part of its response time, the change of a speed is linear in the integrals of the inputs, of the speed
itself and of its sign (dry friction) - the regression behind integral least squares (Innocenti et al., section 4). It is
good enough to tell a silent sensor, a sign or a disturbed stretch, and no estimate comes of it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..logs.log import Log
from ..logs.noise import white_level
from .motion import response, speed

Array = NDArray[np.float64]


FRICTION = 1
"""Column of `Windows.nuisance` that dry friction scales."""


@dataclass(frozen=True)
class Windows:
    """One output over N windows: what its change is left with, and the inputs, once friction is projected out."""

    name: str
    mixing: Array  # [nu]
    starts: NDArray[np.int_]  # [N] sample at which each window starts
    change: Array  # [N]
    drive: Array  # [N, nu] integrals of the inputs
    nuisance: Array  # [N, m] integrals of the speed, of its sign, of 1, and of products of speeds
    undirected: (
        Array  # [N] seconds in which the noise hides the sign of the speed, so that dry friction may act either way
    )

    def projected(self) -> tuple[Array, Array]:
        """`(change [N], drive [N, nu])` without what the nuisance regressors explain."""
        q, _ = np.linalg.qr(self.nuisance)
        return self.change - q @ (q.T @ self.change), self.drive - q @ (q.T @ self.drive)


def integral(log: Log, rates: Array, starts: NDArray[np.int_], stops: NDArray[np.int_]) -> Array:
    """Integral of `rates[k]`, held over interval k, from sample `starts` to sample `stops`."""
    steps = np.diff(log.time).reshape(-1, *[1] * (rates.ndim - 1))
    total = np.concatenate([np.zeros((1, *rates.shape[1:])), np.cumsum(rates[:-1] * steps, axis=0)])
    return total[stops] - total[starts]


def speed_windows(log: Log, share: float = 0.25) -> list[Windows]:
    """Every measured output over windows of a share of the response time."""
    width = max(1, int(share * response(log)))
    starts = np.arange(0, len(log) - width, width)
    found = []
    speeds = [np.nan_to_num(speed(log, name)) for name in log.channels.mixing if name in log.measured]
    # Turning frames and inertia that varies couple the speeds by products (the papers' coupled equations).
    products = [a * b for k, a in enumerate(speeds) for b in speeds[k:]] if len(speeds) > 1 else []
    for name, gains in log.channels.mixing.items():
        if name not in log.measured:
            continue
        values = speed(log, name)
        stops = starts + width
        missing = np.concatenate([[0], np.cumsum(np.isnan(values))])
        good = missing[stops + 1] == missing[starts]
        first, last = starts[good], stops[good]
        if len(first) < 20 + 3 * len(gains) + len(products):
            continue
        moving = np.where(np.isfinite(values), values, 0.0)
        middle = moving.copy()
        middle[:-1] = (moving[:-1] + moving[1:]) / 2
        directed = np.abs(middle) > 3 * white_level(values)
        direction = np.where(directed, np.sign(middle), 0.0)
        nuisance = np.stack([middle, direction, np.ones(len(log)), *products], axis=-1)
        found.append(
            Windows(
                name,
                np.asarray(gains),
                first,
                moving[last] - moving[first],
                integral(log, log.inputs, first, last),
                integral(log, nuisance, first, last),
                integral(log, np.where(directed, 0.0, 1.0), first, last),
            )
        )
    return found


def excited(windows: Windows, least: float = 0.1) -> bool:
    """Whether the inputs drove this output: its combination against the largest that the inputs could form."""
    push = windows.drive @ windows.mixing
    most = np.abs(windows.drive) @ np.abs(windows.mixing)
    return bool(np.std(push) > least * np.sqrt(np.mean(most**2)) > 0)
